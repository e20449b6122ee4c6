//! Where does the stated lag of a voltage drive act?
//!
//! Behind a winding's inductance it is the current that follows late, and the back-EMF pushes against it. A speed controller
//! ramps its duty instead: the voltage follows late, and the current at once. A rig description has one number for
//! either; both are tried on the baseline, and the likelier stays.

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::data::{Driving, Prepared};

/// The recordings with the lag on what is commanded, where the rig states one and a voltage is commanded.
pub fn lag_on_command(recordings: &[Prepared], rig: &Rig) -> Option<Vec<Prepared>> {
    let lags = rig.amplifier.kind == AmplifierKind::Voltage && rig.amplifier.time_constant_s.value > 0.0;
    let commanded = recordings.iter().all(|r| matches!(r.driving, Driving::Command(_)));
    (lags && commanded)
        .then(|| recordings.iter().map(|r| Prepared { lag_on_command: true, ..r.clone() }).collect())
}

/// What was taken for true.
pub fn words() -> &'static str {
    "amplifier.time_constant_s is taken for a lag of the voltage, as where a speed controller ramps its duty, which fits better than a lag of the current behind the back-EMF; a rig that is written keeps the number alone, and simulates the current's"
}

#[cfg(test)]
mod tests {
    use crate::readings::tests::read_and_said;

    const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.03, tol = 0.3 }\n\
                       torque_constant_nm_a = { value = 1.0, tol = 0.1 }\nwinding_resistance_ohm = 1.0\n\
                       [amplifier]\nkind = \"voltage\"\ntime_constant_s = { value = 0.03, tol = 1.0 }\n\
                       [sensors]\ncontrol_rate_hz = 200\n";

    /// A motor with a time constant of 30 ms under steps of voltage, logged every 5 ms; the voltage follows 20 ms late, or
    /// the current does. Whether the lag is taken for the voltage's, and whether the report says so.
    fn taken_for_the_voltages(ramped: bool) -> (bool, bool) {
        const DT: f64 = 1e-4;
        let (mut volts, mut current, mut speed) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut columns = [Vec::new(), Vec::new()];
        for k in 0..150_000_usize {
            let step = k / 3000;
            let wanted = 5.0 * ((step * step * 7919) as f64 * 0.37).sin();
            if k % 50 == 0 {
                let noise = 0.002 * ((k * k % 9973) as f64 * 0.37).sin();
                columns[0].push(wanted);
                columns[1].push(speed + noise);
            }
            volts = if ramped { volts + (wanted - volts) / 0.02 * DT } else { wanted };
            let flows = volts - speed;
            current = if ramped { flows } else { current + (flows - current) / 0.02 * DT };
            speed += current / 0.03 * DT;
        }
        let [driver, speeds] = columns;
        let columns = [("voltage_cmd_v", driver), ("shaft_speed_rad_s", speeds)];
        read_and_said(RIG, 0.005, columns, |read| read.lag_on_command, "lag of the voltage")
    }

    #[test]
    fn the_likelier_place_is_taken_and_said() {
        assert_eq!(taken_for_the_voltages(true), (true, true));
        assert_eq!(taken_for_the_voltages(false), (false, false));
    }
}
