//! Terms driven by a column that no part of the model reads: an unknown signal as a possible cause of what is
//! left. A gain and an offset, on the path where it acts.

use kort_thruster::both;
use kort_thruster::effects::{
    Available, Descriptor, EXTRA, Effect, Hooks, Path, Spec, free_shaft, one_start, thrust_measured, wet,
};
use kort_thruster::plant::{Balance, Drive, Local, Sensed, Tick};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;

use crate::nameless::nameless;

/// What a term acts on.
#[derive(Clone, Copy)]
enum Place {
    Shaft,
    Blade,
    Sensor,
}

struct Driven<T> {
    place: Place,
    gain: T,
    offset: T,
    /// The column now, in standard deviations from its mean.
    column: f64,
}

impl<T: Real> Driven<T> {
    fn boxed(place: Place, values: &[T]) -> Box<dyn Effect<T>> {
        Box::new(Self { place, gain: values[0], offset: values[1], column: 0.0 })
    }

    fn action(&self) -> T {
        self.gain * self.column + self.offset
    }
}

impl<T: Real> Effect<T> for Driven<T> {
    fn hooks(&self) -> Hooks {
        match self.place {
            Place::Sensor => Hooks { drive: true, sense: true, ..Hooks::NONE },
            _ => Hooks { drive: true, balance: true, ..Hooks::NONE },
        }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive<T>) {
        self.column = tick.extra;
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        match self.place {
            Place::Shaft => balance.shaft_torque_n_m += self.action(),
            _ => balance.thrust_n += self.action(),
        }
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n += self.action();
    }
}

fn sizes(unit: &'static str, size: f64) -> Vec<Spec> {
    vec![
        Spec::strength("gain", unit, 0.02 * size, -size, size).sigma(0.1 * size),
        Spec::strength("offset", unit, 0.02 * size, -size, size).sigma(0.1 * size),
    ]
}

fn column_there(available: &Available) -> Result<(), &'static str> {
    if available.has(EXTRA) { Ok(()) } else { Err("no column is recorded that the model has no use for") }
}

macro_rules! driven {
    ($name:ident, $id:literal, $path:ident, $equation:literal, $needs:expr, $parameters:expr) => {
        pub(crate) const $name: Descriptor = nameless! {
            id: $id,
            path: Path::$path,
            what: "a term without a name, driven by a column",
            equation: $equation,
            parameters: $parameters,
            starts: one_start,
            needs: $needs,
            build: both!(|values, _| Driven::boxed(Place::$path, values)),
        };
    };
}

driven!(
    SHAFT,
    "unknown_shaft_over_column",
    Shaft,
    "shaft torque [N m] over a column",
    |rig: &Rig, available: &Available| free_shaft(rig, available).and(column_there(available)),
    |s| sizes("N m", s.torque_n_m)
);
driven!(
    BLADE,
    "unknown_blade_over_column",
    Blade,
    "thrust [N] over a column",
    |rig: &Rig, available: &Available| wet(rig, available).and(column_there(available)),
    |s| sizes("N", s.thrust_n)
);
driven!(
    SENSOR,
    "unknown_sensor_over_column",
    Sensor,
    "addition to the thrust reading [N] over a column",
    |rig: &Rig, available: &Available| thrust_measured(rig, available).and(column_there(available)),
    |s| sizes("N", s.thrust_n)
);

/// The term's numbers as words, if it is one of these: per standard deviation of the column about its mean.
pub(crate) fn expression(term: &Descriptor, values: &[f64]) -> Option<String> {
    let unit = (term.parameters)(&kort_thruster::effects::Scale::ANY)[0].unit;
    term.id.ends_with("_over_column").then(|| {
        format!("{:+.4} {unit} a standard deviation about its mean, {:+.4} {unit}", values[0], values[1])
    })
}
