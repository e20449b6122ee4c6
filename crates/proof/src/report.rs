//! What a diagnosis report says, read from its JSON (`kort.diagnosis`, version 1 or 2).

use serde_json::Value;

/// A report.
pub struct Report<'a>(pub &'a Value);

/// A named effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Named<'a> {
    /// Catalogue id.
    pub effect: &'a str,
    /// Stated probability.
    pub probability: f64,
    /// Held-out excess error that it removes.
    pub removed: f64,
    /// The finding itself.
    pub body: &'a Value,
}

impl<'a> Report<'a> {
    /// Verdict; `error` where there is none.
    pub fn verdict(&self) -> &'a str {
        self.0["verdict"].as_str().unwrap_or("error")
    }

    /// Findings, in the report's order.
    pub fn findings(&self) -> Vec<Named<'a>> {
        Self::list(&self.0["findings"])
            .filter_map(|body| {
                Some(Named {
                    effect: body["effect"].as_str()?,
                    probability: body["probability"].as_f64().unwrap_or(0.0),
                    removed: body["heldout"]["excess_error_removed"].as_f64().unwrap_or(0.0),
                    body,
                })
            })
            .collect()
    }

    /// Effects set aside, with their probability.
    pub fn alternatives(&self) -> Vec<(&'a str, f64)> {
        Self::list(&self.0["alternatives"])
            .filter_map(|body| Some((body["effect"].as_str()?, body["probability"].as_f64().unwrap_or(0.0))))
            .collect()
    }

    /// Probability of an effect, wherever the report states it; zero where it does not.
    pub fn probability(&self, effect: &str) -> f64 {
        let found = self.findings().into_iter().find(|named| named.effect == effect);
        let aside = || self.alternatives().into_iter().find(|(id, _)| *id == effect).map(|(_, p)| p);
        found.map(|named| named.probability).or_else(aside).unwrap_or(0.0)
    }

    /// Every id that the report names as a candidate: findings and what they are confounded with.
    pub fn candidates(&self) -> Vec<&'a str> {
        let mut ids = Vec::new();
        for named in self.findings() {
            ids.push(named.effect);
            ids.extend(Self::list(&named.body["confounded_with"]).filter_map(Value::as_str));
        }
        ids
    }

    /// Path that the report blames for what has no name: of the nameless term, of the remainder, else of
    /// the first mismatch.
    pub fn nameless_path(&self) -> Option<&'a str> {
        ["empirical_term", "remainder"]
            .iter()
            .find_map(|key| self.0[*key]["path"].as_str())
            .or_else(|| self.0["mismatch"][0]["path"].as_str())
    }

    /// Physics without a name is said to be there.
    pub fn flags_nameless(&self) -> bool {
        match self.verdict() {
            "unexplained" => true,
            "partly_explained" => !self.0["remainder"].is_null() || !self.0["empirical_term"].is_null(),
            _ => false,
        }
    }

    /// Mean over channels of the baseline's error, held out, in shares of full scale: before; and after the
    /// findings or the nameless term that leave least.
    pub fn errors(&self) -> (Option<f64>, Option<f64>) {
        let mean =
            |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let channels = |value: &'a Value, key: &str| -> Vec<f64> {
            value.as_object().into_iter().flatten().filter_map(|(_, channel)| channel[key].as_f64()).collect()
        };
        let before = mean(channels(&self.0["baseline"]["channels"], "nrmse_heldout"));
        let findings = self.findings();
        let bodies = findings.iter().map(|named| named.body).chain([&self.0["empirical_term"]]);
        let after = bodies
            .filter_map(|body| mean(channels(&body["heldout"]["channels"], "nrmse_after")))
            .min_by(f64::total_cmp);
        (before, after.or(before))
    }

    /// Seconds that the diagnosis took.
    pub fn seconds(&self) -> f64 {
        self.0["took_seconds"].as_f64().unwrap_or(0.0)
    }

    fn list(value: &'a Value) -> impl Iterator<Item = &'a Value> {
        value.as_array().map(Vec::as_slice).unwrap_or_default().iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_report_is_read_in_both_versions() {
        let body = json!({
            "verdict": "partly_explained", "remainder": { "path": "flow" },
            "findings": [{ "effect": "a", "probability": 0.8, "confounded_with": ["b"],
                           "heldout": { "excess_error_removed": 0.7, "channels": { "x": { "nrmse_after": 0.01 } } } }],
            "alternatives": [{ "effect": "c", "probability": 0.1 }],
            "baseline": { "channels": { "x": { "nrmse_heldout": 0.05 }, "y": { "nrmse_heldout": 0.03 } } } });
        let report = Report(&body);
        assert_eq!(
            (report.verdict(), report.nameless_path(), report.flags_nameless()),
            ("partly_explained", Some("flow"), true)
        );
        assert_eq!(report.candidates(), ["a", "b"]);
        assert_eq!(
            (report.probability("a"), report.probability("c"), report.probability("z")),
            (0.8, 0.1, 0.0)
        );
        assert_eq!(report.errors(), (Some(0.04), Some(0.01)));
        let first = json!({ "verdict": "unexplained", "empirical_term": { "path": "shaft" }, "mismatch": [{ "path": "blade" }] });
        assert_eq!((Report(&first).nameless_path(), Report(&first).flags_nameless()), (Some("shaft"), true));
        assert_eq!(Report(&json!({})).verdict(), "error");
    }
}
