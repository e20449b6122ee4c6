//! A rig description with fitted values in place of stated ones; order and everything that was not fitted stay as
//! they are. The comment behind a stated value told where that came from, and makes room for where the new one does.

use kort_diagnose::report::ParameterReport;
use kort_thruster::rig::Rig;
use toml_edit::{Decor, DocumentMut, InlineTable, Item, Value};

/// What stands behind each value that `kort fit` writes.
pub const FITTED: &str = "fitted by kort fit";
/// Least and largest tolerance written.
const TOL: (f64, f64) = (1e-4, 2.0);

/// Puts fitted values into a rig description, each with its unit and `by` behind it. Also returned: which could not be written, and why.
///
/// # Errors
/// The text is no rig description (it was one when the fit read it).
pub fn with_fitted(
    text: &str,
    parameters: &[ParameterReport],
    by: &str,
) -> Result<(String, Vec<String>), String> {
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
        let in_one_line = document[table].is_inline_table();
        let item = &mut document[table][p.name.as_str()];
        let mut quantity = InlineTable::new();
        quantity.insert("value", short(p.value).into());
        let tol = (2.0 * p.std_error / p.value).abs();
        if tol.is_finite() {
            quantity.insert("tol", short(tol.clamp(TOL.0, TOL.1)).into());
        }
        let mut value = Value::InlineTable(quantity);
        // A comment amid a line would swallow the rest of it.
        let told = if in_one_line { String::new() } else { format!(" # {}, {by}", p.unit) };
        *value.decor_mut() = Decor::new(" ", told);
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

    const RIG: &str = "# the stand\n[propeller]\nradius_m = 0.13 # by ruler\nduct_length_m = 0.1271\npitch_rad = 0.39 # from the drawing\nlift_max = { value = 0.542, tol = 0.15 }\ndrag_max = 1.25\n[flow]\ndensity_kg_m3 = 998\nflux_coefficient = 1.86\nadded_mass_coefficient = 2.0\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.25\nviscous_friction_nm_s = 0.001\n";

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
        let (text, left_out) = with_fitted(RIG, &parameters, "measured by kort calibrate").unwrap();
        let rig = Rig::from_toml(&text).unwrap();
        let propeller = rig.propeller.unwrap();
        assert_eq!((propeller.pitch_rad.value, propeller.pitch_rad.tol), (0.4, Some(0.05)));
        assert_eq!(propeller.lift_max.tol, Some(0.02));
        assert!(left_out.is_empty() && text.starts_with("# the stand"), "{text}");
        // Where a stated value came from is no word on the new one.
        let told = "pitch_rad = { value = 0.4, tol = 0.05 } # 1, measured by kort calibrate\n";
        assert!(text.contains(told) && !text.contains("from the drawing"), "{text}");
        assert!(text.contains("radius_m = 0.13 # by ruler\n"), "{text}");
    }

    #[test]
    fn a_table_in_one_line_stays_whole() {
        let motor = RIG.find("[motor]\n").unwrap();
        let keys = RIG[motor + 8..].trim_end().replace('\n', ", ");
        let rig = format!("motor = {{ {keys} }}\n{}", &RIG[..motor]);
        let (text, left_out) = with_fitted(&rig, &[fitted("inertia_kg_m2", 0.02, 0.001)], FITTED).unwrap();
        let read = Rig::from_toml(&text).unwrap();
        assert!(left_out.is_empty() && read.motor.inertia_kg_m2.value == 0.02, "{text} {left_out:?}");
    }

    #[test]
    fn what_no_rig_may_state_is_said() {
        let parameters = [fitted("viscous_friction_nm_s", -0.002, 0.0001), fitted("efficiency", 0.9, 0.01)];
        let (text, left_out) = with_fitted(RIG, &parameters, "measured by kort calibrate").unwrap();
        assert_eq!(text, RIG);
        assert!(left_out[0].contains("viscous_friction_nm_s") && left_out[1].contains("efficiency"));
    }
}
