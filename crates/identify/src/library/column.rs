//! Terms that follow a further column of the recording.

use super::*;

/// Terms that follow a further column of the recording (as [`Tick::extra`], standardised).
pub const COLUMN_TERMS: &[&Descriptor] = &[&COLUMN_SHAFT, &COLUMN_DRIVE, &COLUMN_AMBIENT, &COLUMN_THRUST];

/// Column terms read the column once a tick and act at once.
struct ColumnTerm<T> {
    values: Values<T>,
    now: f64,
    act: Act<T>,
}

impl<T: Real> Effect<T> for ColumnTerm<T> {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, ..Hooks::NONE }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive<T>) {
        self.now = tick.extra;
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        (self.act)(&Values { size: self.values.size * self.now, ..self.values }, at, balance);
    }
}

fn column(name: &'static str, unit: &'static str, size: f64, reference: f64) -> Vec<Spec> {
    specs(name, unit, size, reference, Spec::shape("exponent", "1", 1.0, 1.0, 1.0))
}

fn following<T: Real>(v: &[T], act: Act<T>) -> Box<dyn Effect<T>> {
    Box::new(ColumnTerm { values: values(v), now: 0.0, act })
}

term!(
    COLUMN_SHAFT,
    "term_column_shaft",
    Path::Shaft,
    "shaft torque -k x tanh(10 Om/Om0)",
    free_shaft,
    |s| column("load_torque_n_m", "N m", 0.02 * s.torque_n_m, s.shaft_speed_rad_s),
    one_start,
    |v, _| {
        following(v, |v, at, b| {
            b.shaft_torque_n_m -= v.size * (at.shaft_speed_rad_s * 10.0 / v.reference).tanh()
        })
    }
);
term!(
    COLUMN_DRIVE,
    "term_column_drive",
    Path::Drive,
    "command (1 + k x)",
    commanded,
    |s| column("gain_change", "1", 0.02, s.command),
    one_start,
    |v, _| { Box::new(DriveTerm { values: values(v), act: |v, tick, u| v.size * u * tick.extra }) }
);
term!(
    COLUMN_AMBIENT,
    "term_column_ambient",
    Path::Flow,
    "ambient flow + k x",
    wet,
    |s| column("ambient_m_s", "m/s", 0.02 * s.flow_m_s, s.flow_m_s),
    one_start,
    |v, _| { following(v, |v, _, b| b.ambient_m_s += v.size) }
);
term!(
    COLUMN_THRUST,
    "term_column_thrust",
    Path::Sensor,
    "thrust reading + k x",
    thrust_measured,
    |s| column("thrust_reading_n", "N", 0.02 * s.thrust_n, s.thrust_n),
    one_start,
    |v, _| { Box::new(ThrustTerm { values: values(v), act: |v, tick, _| v.size * tick.extra }) }
);
