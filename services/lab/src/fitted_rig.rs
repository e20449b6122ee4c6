//! A rig description with fitted values in place of stated ones; order and everything that was not fitted stay as
//! they are. The comment behind a stated value told where that came from, and makes room for where the new one does.

use kort_diagnose::report::ParameterReport;
use kort_identify::identify::FitReport;
use kort_identify::scores::FittedEffect;
use kort_thruster::effects::{self, Scale};
use kort_thruster::parameters::Parameter;
use kort_thruster::rig::{FoundEffect, Quantity, Rig, TOL, short, written};
use toml_edit::{Decor, DocumentMut, Item, TableLike, Value};

/// What stands behind each value that `kort fit` writes.
pub const FITTED: &str = "fitted by kort fit";
/// Begins the lines at the head of a fitted rig that say what is not in it.
const NOT_WRITTEN: &str = "# not written by kort fit: ";

/// Why what was recorded does not fix a value.
const NOT_FIXED: &str = "nothing recorded fixes it";

/// A rig description with what a fit of it found, and at its head what was not written of that, which is also returned.
///
/// # Errors
/// The text is no rig description (it was one when the fit read it).
pub fn with_fit(text: &str, report: &FitReport) -> Result<(String, Vec<String>), String> {
    let (kept, fixed) = parted(report);
    let (text, mut left_out) = with_fitted(text, &fixed, FITTED)?;
    left_out.extend(kept.iter().map(|p| format!("{} stays as stated: the recordings do not fix it", p.name)));
    let (text, effects_left_out) = with_fitted_effects(&text, &report.effects, &open(report), FITTED)?;
    left_out.extend(effects_left_out);
    let head: String =
        left_out.iter().map(|why| format!("{NOT_WRITTEN}{}\n", why.replace('\n', " "))).collect();
    // Those of a fit before told of that one.
    let rest = text.split_inclusive('\n').filter(|line| !line.starts_with(NOT_WRITTEN));
    Ok((head + &rest.collect::<String>(), left_out))
}

/// Names of what the recordings alone do not fix, of the rig and of effects.
pub fn open(report: &FitReport) -> Vec<&str> {
    report.not_identifiable.iter().flat_map(|group| &group.parameters).map(String::as_str).collect()
}

/// Parameters that the recordings leave to what the rig states, and those that they fix: a fitted value of the first is the
/// statement's, pulled about by the rest, and is not written as if it had been measured.
pub fn parted(report: &FitReport) -> (Vec<ParameterReport>, Vec<ParameterReport>) {
    let open = open(report);
    let of_rig = |name: &str| Parameter::ALL.iter().any(|of_rig| of_rig.name() == name);
    let (mut kept, fixed): (Vec<_>, Vec<_>) =
        report.parameters.iter().cloned().partition(|p| open.contains(&p.name.as_str()));
    kept.retain(|p| of_rig(&p.name));
    (kept, fixed)
}

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
        if let Some(why) = untold(p) {
            left_out.push(format!("{} stays as stated: {why}", p.name));
            continue;
        }
        let before = document.to_string();
        let in_one_line = document[table].is_inline_table();
        // A comment amid a line would swallow the rest of it.
        let told = if in_one_line { String::new() } else { format!(" # {}, {by}", p.unit) };
        document[table][p.name.as_str()] = item(p, &told);
        // A value that no rig may state (a symptom) keeps the stated one.
        if let Err(e) = Rig::from_toml(&document.to_string()) {
            left_out.push(format!("keeps the stated {}: {}", p.name, e.to_string().replace('\n', "; ")));
            document = before.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
        }
    }
    Ok((document.to_string(), left_out))
}

/// Puts fitted effects among a rig description's `[[effects]]`; what the fit held of one that stands there stays as it is, and
/// what nothing recorded fixes (`open`). Also returned: which could not be written, and why.
///
/// # Errors
/// The text is no rig description (it was one when the fit read it).
pub fn with_fitted_effects(
    text: &str,
    effects: &[FittedEffect],
    open: &[&str],
    by: &str,
) -> Result<(String, Vec<String>), String> {
    let (mut text, mut left_out) = (text.to_owned(), Vec::new());
    for fitted in effects {
        let id = &fitted.effect;
        let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
        let stands = standing(&mut document, id).is_some();
        let (parameters, not_written) = if stands { as_it_is_now(fitted, open) } else { new(fitted) };
        left_out.extend(not_written);
        if parameters.is_empty() {
            continue;
        }
        match with_one(&text, id, &parameters, by) {
            Ok(written) => text = written,
            Err(why) => left_out.push(format!("{id}: {}", why.replace('\n', "; "))),
        }
    }
    Ok((text, left_out))
}

/// Puts one effect's values among a rig description's `[[effects]]`.
fn with_one(text: &str, id: &str, parameters: &[&ParameterReport], by: &str) -> Result<String, String> {
    let parse = |text: &str| text.parse().map_err(|e: toml_edit::TomlError| e.to_string());
    let mut document: DocumentMut = parse(text)?;
    if standing(&mut document, id).is_none() {
        let parameters = parameters.iter().map(|p| (p.name.as_str(), quantity(p))).collect();
        let found = FoundEffect { effect: id, parameters };
        document = parse(&Rig::with_effects_toml(text, &[found], by).map_err(|e| e.to_string())?)?;
    }
    let Some((table, in_one_line)) = standing(&mut document, id) else { return Ok(document.to_string()) };
    for p in parameters {
        let why = untold(p).map_or_else(String::new, |why| format!("; {why}"));
        let told = if in_one_line { String::new() } else { format!(" # {}, {by}{why}", p.unit) };
        table.insert(&p.name, item(p, &told));
    }
    let written = document.to_string();
    Rig::from_toml(&written).map(|_| written).map_err(|e| e.to_string())
}

/// What is written of an effect that stands in the rig, and why the rest is not: all that is fixed, also what may as well be
/// zero by now, since the fit ran with it and the value that stands there is refuted.
fn as_it_is_now<'a>(fitted: &'a FittedEffect, open: &[&str]) -> (Vec<&'a ParameterReport>, Vec<String>) {
    let (kept, known): (Vec<_>, Vec<_>) =
        fitted.parameters.iter().partition(|p| open.contains(&p.name.as_str()));
    let why = |p: &&ParameterReport| format!("{}: {} stays as stated: {NOT_FIXED}", fitted.effect, p.name);
    (known, kept.iter().map(why).collect())
}

/// What is written of an effect that the rig does not have yet, and why the rest is not. Nothing where none of its strengths
/// is known: it is not known to be there at all. Once one is, so are the others as far as the fit has them, since a strength that a
/// rig does not state is exactly zero; only what was fitted as that is left out, having no tolerance. What the recordings fix
/// only together with what the rig states roughly has the tolerance that both give.
fn new(fitted: &FittedEffect) -> (Vec<&ParameterReport>, Vec<String>) {
    let specs = effects::find(&fitted.effect).map_or_else(Vec::new, |e| (e.parameters)(&Scale::ANY));
    let is_shape = |p: &ParameterReport| specs.iter().any(|spec| spec.name == p.name && spec.shape);
    let unsure = |p: &ParameterReport| {
        let (value, error) = (short(p.value), short(p.std_error));
        let nothing = p.value == 0.0 || tolerance(p) > TOL.1;
        nothing
            .then(|| format!("{} = {value} {}, standard error {error}, may as well be zero", p.name, p.unit))
    };
    let strengths: Vec<_> = fitted.parameters.iter().filter(|p| !is_shape(p)).collect();
    let why: Vec<String> = strengths.iter().filter_map(|p| unsure(p)).collect();
    if !why.is_empty() && why.len() == strengths.len() {
        return (Vec::new(), vec![format!("{} is left out: {}", fitted.effect, why.join("; "))]);
    }
    let (known, nothing): (Vec<_>, Vec<_>) =
        fitted.parameters.iter().partition(|p| is_shape(p) || p.value != 0.0);
    let why = nothing.into_iter().filter_map(unsure).map(|why| format!("{}: {why}", fitted.effect));
    (known, why.collect())
}

/// Why no tolerance says how well a value is known, if none does.
fn untold(fitted: &ParameterReport) -> Option<String> {
    match fitted.at_bound {
        Some(true) => Some(format!(
            "{} {} is at the bound of what is allowed, no measurement",
            short(fitted.value),
            fitted.unit
        )),
        _ if fitted.value == 0.0 && fitted.std_error > 0.0 => {
            Some("a tolerance is relative, and zero has none".into())
        }
        _ if tolerance(fitted) > TOL.1 => Some(format!(
            "{} {} has a standard error of {}, more than the largest tolerance of a rig",
            short(fitted.value),
            fitted.unit,
            short(fitted.std_error)
        )),
        _ => None,
    }
}

/// The table of an effect that stands in a rig description, and whether the whole of it stands in one line.
fn standing<'a>(document: &'a mut DocumentMut, effect: &str) -> Option<(&'a mut dyn TableLike, bool)> {
    let named = |table: &dyn TableLike| table.get("effect").and_then(Item::as_str) == Some(effect);
    match document.get_mut("effects")? {
        Item::ArrayOfTables(list) => {
            let table = list.iter_mut().find(|table| named(*table))?;
            Some((table, false))
        }
        Item::Value(Value::Array(list)) => {
            let mut tables = list.iter_mut().filter_map(Value::as_inline_table_mut);
            let table = tables.find(|table| named(*table))?;
            Some((table, true))
        }
        _ => None,
    }
}

/// A fitted value as it stands in a rig description, with what is told behind it.
fn item(fitted: &ParameterReport, told: &str) -> Item {
    let mut value = written(quantity(fitted));
    *value.decor_mut() = Decor::new(" ", told);
    Item::Value(value)
}

/// A fitted value, with twice its standard error as tolerance: the largest there is at a bound, where the error says nothing.
pub fn quantity(fitted: &ParameterReport) -> Quantity {
    let tol = if fitted.at_bound == Some(true) && fitted.value != 0.0 { TOL.1 } else { tolerance(fitted) };
    Quantity { value: fitted.value, tol: Some(tol).filter(|t| t.is_finite() && *t > 0.0) }
}

/// Twice its standard error, over its value.
fn tolerance(fitted: &ParameterReport) -> f64 {
    (2.0 * fitted.std_error / fitted.value).abs()
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
    fn an_effect_has_what_was_fitted_of_it_and_keeps_what_was_held() {
        let known = "[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = { value = 0.3, tol = 0.5 } # by hand\nstribeck_rise = 0.2 # from the maker\nstribeck_speed_rad_s = 2.0\n";
        let effect = |name: &str, parameters: Vec<ParameterReport>| FittedEffect {
            effect: name.into(),
            path: "shaft".into(),
            equation: String::new(),
            parameters,
        };
        let friction = effect("coulomb_friction", vec![fitted("coulomb_torque_n_m", 0.25, 0.01)]);
        let unknown = effect("gremlins", vec![fitted("number", 3.0, 1.0)]);
        let (text, left_out) =
            with_fitted_effects(&format!("{RIG}{known}"), &[friction, unknown], &[], FITTED).unwrap();
        assert!(
            text.contains("coulomb_torque_n_m = { value = 0.25, tol = 0.08 } # 1, fitted by kort fit"),
            "{text}"
        );
        assert!(text.contains("stribeck_rise = 0.2 # from the maker\n"), "{text}");
        assert!(left_out.len() == 1 && left_out[0].contains("gremlins"), "{left_out:?}");
    }

    #[test]
    fn what_may_as_well_be_zero_is_not_written_as_known() {
        let one = |effect: &str, parameters: Vec<ParameterReport>| FittedEffect {
            effect: effect.into(),
            path: "drive".into(),
            equation: String::new(),
            parameters,
        };
        let at_bound = |p: ParameterReport| ParameterReport { at_bound: Some(true), ..p };
        let none = one("transport_delay", vec![at_bound(fitted("delay_s", 0.0, 1e-3))]);
        let unsure = one(
            "coulomb_friction",
            vec![
                fitted("coulomb_torque_n_m", 0.02, 0.03),
                fitted("stribeck_rise", 0.2, 0.01),
                fitted("stribeck_speed_rad_s", 2.0, 0.1),
            ],
        );
        let (text, left_out) = with_fitted_effects(RIG, &[none.clone(), unsure], &[], FITTED).unwrap();
        assert!(
            left_out.len() == 2 && left_out.iter().all(|why| why.contains("may as well be zero")),
            "{left_out:?}"
        );
        assert!(!text.contains("transport_delay") && !text.contains("coulomb_torque_n_m"), "{text}");
        // What stands there is refuted: the fit ran without it. Where nothing fixed it, it stays.
        let known = format!(
            "{RIG}[[effects]]\neffect = \"transport_delay\"\ndelay_s = {{ value = 0.03, tol = 2 }}\n"
        );
        let (text, left_out) = with_fitted_effects(&known, std::slice::from_ref(&none), &[], FITTED).unwrap();
        assert_eq!(Rig::from_toml(&text).unwrap().effects[0].value("delay_s"), 0.0, "{text}");
        assert!(left_out.is_empty() && text.contains("delay_s = 0.0 # 1, fitted by kort fit"), "{text}");
        let (text, left_out) = with_fitted_effects(&known, &[none], &["delay_s"], FITTED).unwrap();
        assert!(text == known && left_out[0].contains("delay_s stays as stated"), "{text} {left_out:?}");
    }

    #[test]
    fn beside_a_strength_that_is_known_no_other_is_exactly_zero() {
        let cogging = |cos: (f64, f64), sin: (f64, f64)| FittedEffect {
            effect: "torque_ripple_cogging".into(),
            path: "drive".into(),
            equation: String::new(),
            parameters: vec![
                fitted("cogging_cos_1_n_m", cos.0, cos.1),
                fitted("cogging_sin_1_n_m", sin.0, sin.1),
                fitted("order_1", 14.0, 0.0),
            ],
        };
        let written = |effect, open: &[&str]| with_fitted_effects(RIG, &[effect], open, FITTED).unwrap();
        let (text, left_out) = written(cogging((0.2, 0.01), (0.005, 0.01)), &[]);
        let rig = Rig::from_toml(&text).unwrap();
        let sin = rig.effects[0].parameters.iter().find(|(name, _)| *name == "cogging_sin_1_n_m").unwrap();
        assert_eq!((sin.1.value, sin.1.tol), (0.005, Some(2.0)), "{text}");
        assert!(left_out.is_empty(), "{left_out:?}");
        let (text, left_out) = written(cogging((0.2, 0.01), (0.0, 0.01)), &[]);
        assert!(!text.contains("cogging_sin_1_n_m") && left_out.len() == 1, "{text} {left_out:?}");
        // A strength that goes with what the rig states roughly is known as well as that.
        let (text, left_out) = written(cogging((0.2, 0.01), (0.05, 0.01)), &["cogging_cos_1_n_m"]);
        assert!(text.contains("cogging_cos_1_n_m") && left_out.is_empty(), "{text} {left_out:?}");
    }

    #[test]
    fn a_value_at_its_bound_or_unknown_stays_as_stated() {
        let bound = ParameterReport { at_bound: Some(true), ..fitted("lift_max", 1.2, 1e-5) };
        let (text, left_out) =
            with_fitted(RIG, &[bound, fitted("inertia_kg_m2", 0.02, 0.05)], FITTED).unwrap();
        assert_eq!(text, RIG);
        assert!(
            left_out[0].contains("at the bound") && left_out[1].contains("largest tolerance"),
            "{left_out:?}"
        );
    }

    #[test]
    fn what_no_rig_may_state_is_said() {
        let parameters = [fitted("viscous_friction_nm_s", -0.002, 0.0001), fitted("efficiency", 0.9, 0.01)];
        let (text, left_out) = with_fitted(RIG, &parameters, "measured by kort calibrate").unwrap();
        assert_eq!(text, RIG);
        assert!(left_out[0].contains("viscous_friction_nm_s") && left_out[1].contains("efficiency"));
    }
}
