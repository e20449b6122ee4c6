//! What a comparison says, in words.

use std::fmt::Write;

use crate::comparison::{LawResult, PLAIN};
use crate::limits;
use crate::summary::Score;

/// What adaptation is held to: error over that with true parameters.
const RECOVERED: f64 = 1.2;

fn interval(s: Score) -> String {
    match s.ci95 {
        Some([low, high]) if low != high => format!("{:.3} ({low:.3} to {high:.3})", s.mean),
        _ => format!("{:.3}", s.mean),
    }
}

/// Who is best, beside the plain law and the next, how sure that is, and what went wrong.
pub(crate) fn verdict(laws: &[LawResult]) -> String {
    // What is told everything is no law that one could take.
    let mut order: Vec<&LawResult> = laws.iter().filter(|l| l.name != limits::NAME).collect();
    order.sort_by(|a, b| a.mean("thrust_rms_n").total_cmp(&b.mean("thrust_rms_n")));
    let Some(best) = order.first() else { return "nothing ran".into() };
    let mut words = format!(
        "{} has the least thrust error: {} N RMS",
        best.name,
        interval(best.score("thrust_rms_n").unwrap_or(Score { mean: 0.0, ci95: None }))
    );
    let plain = laws.iter().find(|l| l.name == PLAIN);
    if let Some(plain) = plain.filter(|p| p.name != best.name) {
        let of = |score: &str, what: &str| Some(format!("{} of {what}", interval(best.ratio(plain, score)?)));
        let thrust = of("thrust_rms_n", PLAIN).unwrap_or_else(|| format!("an unknown share of {PLAIN}"));
        let energy: Vec<String> = [
            ("energy_j", "its energy"),
            ("energy_per_impulse_j_n_s", "its energy per useful newton-second"),
            ("energy_over_ideal", "its energy over the ideal"),
        ]
        .into_iter()
        .filter_map(|(score, what)| of(score, what))
        .collect();
        let _ = write!(words, ", {thrust}'s");
        // A speed drive shows no current, and its energy is not known.
        if !energy.is_empty() {
            let _ = write!(words, ", for {}", energy.join(", "));
        }
        words += &why_more_energy(best, plain);
    } else if plain.is_some() && order.len() > 1 {
        words += "; the plain law wins here";
    }
    if let Some((next, lead)) = order.get(1).and_then(|next| Some((next, next.ratio(best, "thrust_rms_n")?)))
    {
        if best.by_seed.len() < 2 {
            let _ = write!(
                words,
                ". Next is {} at {:.3} of it; one seed gives no interval, so how sure this is cannot be said",
                next.name, lead.mean
            );
        } else if lead.ends()[0] > 1.0 {
            let _ = write!(
                words,
                ". Next is {} at {} of it: the order is beyond the doubt of {} seeds",
                next.name,
                interval(lead),
                best.by_seed.len()
            );
        } else {
            let _ = write!(
                words,
                ". {} is as good within the doubt of {} seeds: {} of it",
                next.name,
                best.by_seed.len(),
                interval(lead)
            );
        }
    }
    words += &recovered(laws);
    let broken: Vec<&str> =
        laws.iter().filter(|l| l.mean("limits_broken") > 0.0).map(|l| l.name.as_str()).collect();
    if !broken.is_empty() {
        let _ = write!(words, ". LIMITS BROKEN by {}", broken.join(", "));
    }
    let lost: Vec<&str> = laws
        .iter()
        .filter(|l| l.mean("faults_survived") < l.mean("faults_injected"))
        .map(|l| l.name.as_str())
        .collect();
    if !lost.is_empty() {
        let _ = write!(words, ". Not every fault was recovered from by {}", lost.join(", "));
    }
    words + "."
}

/// Where the better law takes more energy: because it gives thrust that the plain law does not, or
/// because it gives it at a worse efficiency.
fn why_more_energy(best: &LawResult, plain: &LawResult) -> String {
    let of = |score| best.ratio(plain, score);
    let (Some(energy), Some(ideal), Some(useful)) =
        (of("energy_j"), of("energy_over_ideal"), of("useful_impulse_n_s"))
    else {
        return String::new();
    };
    if energy.ends()[0] <= 1.0 {
        return String::new();
    }
    // Within a hundredth is the same: one seed has no interval.
    let efficiency = if ideal.ends()[1] < 0.99 {
        "better"
    } else if ideal.ends()[0] <= 1.01 {
        "the same"
    } else {
        "worse"
    };
    format!(
        ": more energy, as it gives {:.3} of the useful newton-seconds, at {efficiency} efficiency",
        useful.mean
    )
}

/// How near the adapting laws come to their error with true parameters, where that was run.
fn recovered(laws: &[LawResult]) -> String {
    let of: Vec<(&LawResult, Score)> =
        laws.iter().filter_map(|l| Some((l, l.score("error_over_true_parameters")?))).collect();
    if of.is_empty() {
        return String::new();
    }
    let list = |adapts: bool| {
        let some = of.iter().filter(|(l, _)| l.score("parameter_error").is_some() == adapts);
        some.map(|(l, s)| format!("{} {}", l.name, interval(*s))).collect::<Vec<_>>().join(", ")
    };
    let mut words = format!(
        ". Error as a multiple of that with true parameters told: {}",
        [list(true), list(false)]
            .into_iter()
            .filter(|l| !l.is_empty())
            .collect::<Vec<_>>()
            .join("; without adaptation ")
    );
    let adapting = of.iter().filter(|(l, _)| l.score("parameter_error").is_some());
    let (back, short): (Vec<_>, Vec<_>) = adapting.partition(|(_, s)| s.mean <= RECOVERED);
    for (laws, which) in [(back, "Back within"), (short, "NOT back within")] {
        let names: Vec<&str> = laws.iter().map(|(l, _)| l.name.as_str()).collect();
        if !names.is_empty() {
            let _ = write!(words, ". {which} {RECOVERED}: {}", names.join(", "));
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Outcome;

    #[test]
    fn energy_that_is_not_known_is_not_spoken_of() {
        let law = |name: &str, rms: f64, energy: f64| {
            let mut outcome = Outcome::default();
            for (score, value) in [
                ("thrust_rms_n", rms),
                ("energy_j", energy),
                ("energy_per_impulse_j_n_s", energy),
                ("energy_over_ideal", energy),
                ("limits_broken", 0.0),
            ] {
                outcome.scores.insert(score, value);
            }
            LawResult::new(name, vec![outcome])
        };
        let of = |energy: f64| verdict(&[law(PLAIN, 2.0, energy), law("better", 1.0, energy)]);
        let words = of(f64::NAN);
        assert!(!words.contains("NaN") && !words.contains("energy"), "{words}");
        assert!(words.contains("0.500 of velocity_servo's."), "{words}");
        assert!(of(3.0).contains("0.500 of velocity_servo's, for 1.000 of its energy, "), "{}", of(3.0));
    }
}
