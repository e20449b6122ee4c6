//! A rig description with fitted values in place of stated ones; comments, order and everything
//! that was not fitted stay as they are.

use kort_diagnose::report::ParameterReport;
use kort_thruster::rig::Rig;
use toml_edit::{DocumentMut, InlineTable, Item, Value};

/// Least and largest tolerance written.
const TOL: (f64, f64) = (1e-4, 2.0);

/// Puts fitted values into a rig description. Also returned: which could not be written, and why.
///
/// # Errors
/// The text is no rig description (it was one when the fit read it).
pub fn with_fitted(text: &str, parameters: &[ParameterReport]) -> Result<(String, Vec<String>), String> {
    let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
    let mut left_out = Vec::new();
    for p in parameters {
        let table = ["propeller", "flow", "motor", "amplifier", "sensors"]
            .into_iter()
            .find(|t| document.get(t).and_then(Item::as_table_like).is_some_and(|t| t.contains_key(&p.name)));
        let Some(table) = table else {
            left_out.push(format!(
                "{} = {} {} has no key in a rig description and is not in the file",
                p.name,
                short(p.value),
                p.unit
            ));
            continue;
        };
        let before = document.to_string();
        let item = &mut document[table][p.name.as_str()];
        let decor = item.as_value().map(|v| v.decor().clone());
        let mut quantity = InlineTable::new();
        quantity.insert("value", short(p.value).into());
        let tol = (2.0 * p.std_error / p.value).abs();
        if tol.is_finite() {
            quantity.insert("tol", short(tol.clamp(TOL.0, TOL.1)).into());
        }
        let mut value = Value::InlineTable(quantity);
        if let Some(decor) = decor {
            *value.decor_mut() = decor;
        }
        *item = Item::Value(value);
        // A value that no rig may state (a symptom) keeps the stated one.
        if let Err(e) = Rig::from_toml(&document.to_string()) {
            left_out.push(format!("keeps the stated {}: {}", p.name, e.to_string().replace('\n', "; ")));
            document = before.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
        }
    }
    Ok((document.to_string(), left_out))
}

/// Six significant digits.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: &str = "# the stand\n[propeller]\nradius_m = 0.13\nduct_length_m = 0.1271\npitch_rad = 0.39 # at 0.7 r\nlift_max = { value = 0.542, tol = 0.15 }\ndrag_max = 1.25\n[flow]\ndensity_kg_m3 = 998\nflux_coefficient = 1.86\nadded_mass_coefficient = 2.0\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.25\nviscous_friction_nm_s = 0.001\n";

    fn fitted(name: &str, value: f64, std_error: f64) -> ParameterReport {
        ParameterReport {
            name: name.into(),
            value,
            unit: "1".into(),
            std_error,
            stated: None,
            at_bound: Some(false),
        }
    }

    #[test]
    fn values_and_tolerances_change_and_the_rest_stays() {
        let parameters = [fitted("pitch_rad", 0.4, 0.01), fitted("lift_max", 0.5, 0.005)];
        let (text, left_out) = with_fitted(RIG, &parameters).unwrap();
        let rig = Rig::from_toml(&text).unwrap();
        let propeller = rig.propeller.unwrap();
        assert_eq!((propeller.pitch_rad.value, propeller.pitch_rad.tol), (0.4, Some(0.05)));
        assert_eq!(propeller.lift_max.tol, Some(0.02));
        assert!(
            left_out.is_empty() && text.starts_with("# the stand") && text.contains("# at 0.7 r"),
            "{text}"
        );
    }

    #[test]
    fn what_no_rig_may_state_is_said() {
        let parameters = [fitted("viscous_friction_nm_s", -0.002, 0.0001), fitted("efficiency", 0.9, 0.01)];
        let (text, left_out) = with_fitted(RIG, &parameters).unwrap();
        assert_eq!(text, RIG);
        assert!(left_out[0].contains("viscous_friction_nm_s") && left_out[1].contains("efficiency"));
    }
}
