//! Zeros of the sensors: what each shows at rest, and the effect of the catalogue that carries it.

use kort_identify::scores::ParameterReport;
use kort_thruster::rig::{Quantity, Rig};

use crate::facts::{ALL_INSIDE, Facts};

/// Signals that have a zero, the effect and its parameter that carry it, and its unit.
const CARRIED: [(&str, &str, &str, &str); 4] = [
    ("thrust_n", "thrust_bias_gain_hysteresis", "bias_n", "N"),
    ("flow_m_s", "flowmeter_offset_lag_location", "flow_offset_m_s", "m/s"),
    ("torque_n_m", "torque_channel_bias", "transducer_offset_n_m", "N m"),
    ("current_a", "torque_channel_bias", "current_offset_a", "A"),
];

/// The zero of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Zero {
    /// Its signal.
    pub signal: &'static str,
    /// The effect that carries it in a rig description.
    pub effect: &'static str,
    /// Its value there.
    pub parameter: ParameterReport,
}

/// The zeros of all that is measured.
pub fn zeros(facts: &Facts) -> Vec<Zero> {
    let measured = CARRIED.into_iter().filter(|(signal, ..)| facts.measures(signal));
    let zero = |(signal, effect, name, unit): (&'static str, &'static str, &str, &str)| {
        let rest = facts.at_rest(signal);
        let parameter = ParameterReport {
            name: name.into(),
            value: rest.mean,
            unit: unit.into(),
            // Of few readings the error is itself hardly known: the stated tolerance has that in it.
            std_error: rest.tolerance() / ALL_INSIDE,
            stated: None,
            at_bound: None,
        };
        Zero { signal, effect, parameter }
    };
    measured.map(zero).collect()
}

/// Takes the zeros out of the readings of these columns.
pub(crate) fn take_out(zeros: &[Zero], columns: &mut [(String, Vec<f64>)]) {
    for (name, values) in columns {
        if let Some(zero) = zeros.iter().find(|zero| zero.signal == name) {
            values.iter_mut().for_each(|value| *value -= zero.parameter.value);
        }
    }
}

/// The rig as it is for readings without their zeros: one that it states would be taken off twice.
pub(crate) fn without(zeros: &[Zero], rig: &mut Rig) {
    for known in &mut rig.effects {
        let names = zeros.iter().filter(|zero| zero.effect == known.effect).map(|zero| &zero.parameter.name);
        let names: Vec<&String> = names.collect();
        for (_, value) in known.parameters.iter_mut().filter(|(name, _)| names.iter().any(|n| *n == name)) {
            *value = Quantity::exact(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facts::RestReading;
    use kort_proto::signals::SIGNALS;
    use kort_thruster::effects;

    const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

    fn at_rest(signal: &str, mean: f64) -> Facts {
        let reading = |name: &str| match name == signal {
            true => RestReading { count: 2000, mean, sigma: 0.5, memory: 1.0, step: 0.0 },
            false => RestReading::default(),
        };
        Facts { rest: SIGNALS.iter().map(|s| reading(s.name)).collect(), ..Facts::default() }
    }

    #[test]
    fn each_zero_is_carried_by_an_effect_of_the_catalogue() {
        for (signal, effect, name, unit) in CARRIED {
            let specs = (effects::find(effect).unwrap().parameters)(&effects::Scale::ANY);
            assert!(specs.iter().any(|spec| spec.name == name && spec.unit == unit && !spec.shape), "{name}");
            let found = zeros(&at_rest(signal, -1.5));
            assert_eq!(found.len(), 1, "what is not measured has none");
            assert_eq!((found[0].signal, found[0].parameter.value), (signal, -1.5));
            let tolerance = at_rest(signal, -1.5).at_rest(signal).tolerance();
            assert!((ALL_INSIDE * found[0].parameter.std_error - tolerance).abs() < 1e-12);
        }
    }

    #[test]
    fn a_zero_that_the_rig_states_already_is_not_taken_off_twice() {
        let found = zeros(&at_rest("thrust_n", 2.0));
        let known =
            "\n[[effects]]\neffect = \"thrust_bias_gain_hysteresis\"\nbias_n = 2.0\ngain_error = 0.05\n";
        let mut rig = Rig::from_toml(&format!("{RIG}{known}")).unwrap();
        without(&found, &mut rig);
        assert_eq!((rig.effects[0].value("bias_n"), rig.effects[0].value("gain_error")), (0.0, 0.05));
        let mut columns = vec![("thrust_n".to_owned(), vec![2.0, 12.0]), ("flow_m_s".to_owned(), vec![1.0])];
        take_out(&found, &mut columns);
        assert_eq!((&columns[0].1, &columns[1].1), (&vec![0.0, 10.0], &vec![1.0]));
    }
}
