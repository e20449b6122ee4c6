//! `kort explain --for RIG`: which controller a rig gets by default, and why.

use std::fmt::Write;
use std::path::Path;

use kort_control::known::uses::{self, Usage};
use kort_control::{Advice, TimeScales, advise};
use serde_json::{Value, json};

use super::WIDTH;
use crate::failure::{Failure, Outcome, print, print_json};
use crate::files;

/// Does it.
///
/// # Errors
/// Names the rig, the key and what is allowed; a dry rig has no thrust to control.
pub fn run(wanted: &Path, json: bool) -> Result<Outcome, Failure> {
    let rig = files::read_rig(wanted)?;
    let period_s = uses::period_s(&rig);
    let advice = advise(&rig, period_s).map_err(|e| Failure::in_file(wanted, e))?;
    let known = uses::of_rig(&rig, period_s).map_err(|e| Failure::in_file(wanted, e))?;
    if json {
        print_json(&document(&rig.name, period_s, &advice, &known))?;
    } else {
        print(&text(&rig.name, period_s, &advice, &known))?;
    }
    Ok(Outcome::Done)
}

/// The time scales in words, with their values in s.
fn scales(s: &TimeScales) -> [(&'static str, &'static str, f64); 6] {
    [
        ("drive_s", "lag and dead time of the drive", s.drive_s),
        ("sensing_s", "from a shaft speed to its measurement", s.sensing_s),
        ("shaft_s", "shaft to top speed under all torque, without load", s.shaft_s),
        ("led_s", "shaft led by the model, the drive's lag inverted", s.led_s),
        ("servo_s", "shaft under the plain velocity servo", s.servo_s),
        ("flow_s", "axial flow at half the largest thrust", s.flow_s),
    ]
}

fn text(rig: &str, period_s: f64, advice: &Advice, known: &[Usage]) -> String {
    let config = &advice.config;
    let mut out = format!("{rig}: controller by default, at a control period of {} ms\n\n", 1e3 * period_s);
    for (_, words, value) in scales(&advice.scales) {
        let _ = writeln!(out, "  {:10.2} ms  {words}", 1e3 * value);
    }
    out.push('\n');
    let names = [config.law.name(), config.observer.name(), config.estimator.name()];
    for ((kind, name), reason) in ["law", "observer", "estimator"].iter().zip(names).zip(&advice.reasons) {
        let line = format!("{kind} {name}: {reason}.");
        out += &textwrap::fill(&line, textwrap::Options::new(WIDTH).subsequent_indent("  "));
        out.push('\n');
    }
    for usage in known {
        let line = format!("known {}: {}.", usage.effect, usage.words());
        out += &textwrap::fill(&line, textwrap::Options::new(WIDTH).subsequent_indent("  "));
        out.push('\n');
    }
    out + "\nThe rule: docs/control.md, \"The default\". Held against the plain servo: kort soak soak-towed --rig RIG \\\n  --controllers velocity_servo,default,drive_limits\n"
}

fn document(rig: &str, period_s: f64, advice: &Advice, known: &[Usage]) -> Value {
    let scales: serde_json::Map<String, Value> =
        scales(&advice.scales).iter().map(|(name, _, value)| ((*name).into(), json!(value))).collect();
    let [law, observer, estimator] = &advice.reasons;
    json!({
        "schema": "kort.explain/1",
        "rig": rig,
        "control_period_s": period_s,
        "controller": advice.config,
        "time_scales": scales,
        "reasons": { "law": law, "observer": observer, "estimator": estimator },
        "known_effects": known
            .iter()
            .map(|u| json!({ "effect": u.effect, "used": u.left.is_none(), "how": u.words() }))
            .collect::<Vec<_>>(),
    })
}
