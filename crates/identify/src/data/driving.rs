//! What drives the model, and what there is where nothing can be compared.

use kort_thruster::rig::{AmplifierKind, Rig};

use super::{Driving, FEWEST_ROWS, Response, Series};

/// The driving column, by preference: a command that fits the drive, then measured current, then speed.
pub(super) fn choose_driving(series: &Series, rig: &Rig, speed_driven: bool) -> Option<Driving> {
    let varies = |name: &str| {
        series.column(name).is_some_and(|c| {
            let first = c.iter().copied().find(|v| v.is_finite());
            c.iter().any(|v| v.is_finite() && Some(*v) != first)
        })
    };
    if speed_driven && varies("shaft_speed_rad_s") {
        return Some(Driving::Speed);
    }
    let commands: &[&'static str] = match rig.amplifier.kind {
        AmplifierKind::Current => &["current_cmd_a"],
        AmplifierKind::Voltage => &["voltage_cmd_v", "duty_cmd"],
        AmplifierKind::Speed => &["speed_cmd_rad_s"],
    };
    if let Some(command) = commands.iter().find(|c| varies(c)) {
        return Some(Driving::Command(command));
    }
    if varies("current_a") && varies("shaft_speed_rad_s")
        || varies("current_a") && rig.amplifier.kind != AmplifierKind::Speed
    {
        return Some(Driving::Current);
    }
    varies("shaft_speed_rad_s").then_some(Driving::Speed)
}

/// What a recording without a usable response holds.
pub(super) fn instead(series: &Series, driving: &str) -> String {
    let few = Response::ALL.into_iter().filter(|r| r.name() != driving).find_map(|r| {
        let samples = series.column(r.name())?.iter().filter(|v| v.is_finite()).count();
        (samples < FEWEST_ROWS)
            .then(|| format!("{} has {samples} samples, at least {FEWEST_ROWS} are needed", r.name()))
    });
    if let Some(few) = few {
        return few;
    }
    let others: Vec<&str> =
        series.columns.iter().map(|c| c.0.as_str()).filter(|n| *n != driving && *n != "time_s").collect();
    let mut found = if others.is_empty() { "nothing else is in it".into() } else { others.join(", ") };
    if let Some(sag) = crate::checks::supply_sag(series).and_then(|sag| sag.words()) {
        found.push_str(&format!("\nnote: {sag}"));
    }
    found
}
