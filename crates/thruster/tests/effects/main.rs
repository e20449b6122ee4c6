//! One suite over every entry of the catalogue: names, parameters, and what each does to the
//! standard rigs of both classes.

mod bench;

use bench::{LEVEL_S, WORK, bench, benches};
use kort_thruster::effects::{self, ALL, Descriptor, Path, Spec};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Sensed, Tick};
use kort_thruster::rig::AmplifierKind;

/// All that is wrong at once, rather than the first.
#[derive(Default)]
struct Failures(Vec<String>);

impl Failures {
    fn unless(&mut self, good: bool, what: impl FnOnce() -> String) {
        if !good {
            self.0.push(what());
        }
    }
}

impl Drop for Failures {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert!(self.0.is_empty(), "{}", self.0.join("\n"));
        }
    }
}

/// Effects that add to Model 2 on a current drive and can be made small: all but what makes Model 2 of the static models,
/// what is no physics, what is there or not, and what another drive has.
fn added() -> impl Iterator<Item = &'static Descriptor> {
    let whole = ["axial_flow_dynamics", "log_gaps", "unsigned_speed_sensor", "drive_freewheels"];
    ALL.iter().copied().filter(move |e| !whole.contains(&e.id))
}

fn starting(specs: &[Spec]) -> Vec<f64> {
    specs.iter().map(|s| s.start).collect()
}

#[test]
fn identifiers_are_unique_and_name_their_files() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/effects");
    for (i, effect) in ALL.iter().enumerate() {
        assert!(folder.join(format!("{}.rs", effect.id)).exists(), "{} has no file", effect.id);
        assert!(ALL[..i].iter().all(|other| other.id != effect.id), "{} twice", effect.id);
        assert_eq!(effects::find(effect.id).unwrap().what, effect.what);
    }
    let files = std::fs::read_dir(&folder).unwrap().filter_map(|f| f.ok()?.file_name().into_string().ok());
    for file in
        files.filter(|f| !["mod.rs", "memory.rs", "knots.rs", "needs.rs", "spec.rs"].contains(&f.as_str()))
    {
        assert!(effects::find(file.trim_end_matches(".rs")).is_some(), "{file} is not in the catalogue");
    }
}

#[test]
fn words_are_whole_and_rivals_exist() {
    for effect in ALL {
        for text in [effect.what, effect.equation, effect.signature, effect.separated_by, effect.reference] {
            assert!(text.len() > 10 && !text.contains("  "), "{}: {text:?}", effect.id);
        }
        assert!(!effect.confused_with.is_empty(), "{}", effect.id);
        for rival in effect.confused_with {
            assert!(effects::find(rival).is_some() && *rival != effect.id, "{} names {rival}", effect.id);
        }
    }
}

#[test]
fn bounds_hold_the_starts() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL {
            let specs = (effect.parameters)(&bench.scale);
            for start in (effect.starts)(&bench.scale).into_iter().chain([starting(&specs)]) {
                assert_eq!(start.len(), specs.len(), "{}", effect.id);
                for (spec, value) in specs.iter().zip(&start) {
                    failures.unless(spec.low <= *value && *value <= spec.high, || {
                        format!("{} {} {value} {spec:?}", bench.name, effect.id)
                    });
                }
                let strong = |(spec, value): (&Spec, &f64)| !spec.shape && *value != 0.0;
                failures
                    .unless(specs.iter().all(|s| s.shape) || specs.iter().zip(&start).any(strong), || {
                        format!("{}: a fit sees nothing at zero", effect.id)
                    });
            }
        }
    }
}

#[test]
fn priors_are_proper_and_wide() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL {
            failures.unless((0.2..=5.0).contains(&effect.commonness), || effect.id.into());
            for s in (effect.parameters)(&bench.scale) {
                let proper =
                    s.held || s.sigma > 0.0 && s.sigma.is_finite() && s.low <= s.mean && s.mean <= s.high;
                failures.unless(proper && (s.shape || s.held || s.mean == 0.0), || {
                    format!("{} {s:?}", effect.id)
                });
                // A fit's start is no surprise to the prior, and the bounds are no tighter than it.
                failures.unless(s.held || (s.start - s.mean).abs() <= 3.0 * s.sigma, || {
                    format!("{} {s:?}", effect.id)
                });
                failures.unless(s.held || s.high - s.low >= s.sigma, || format!("{} {s:?}", effect.id));
            }
        }
    }
}

#[test]
fn forms_are_parts_that_act() {
    for effect in ALL.iter().filter(|e| e.id != "log_gaps") {
        let bench = &benches()[0];
        let specs = (effect.parameters)(&bench.scale);
        let forms = effect.forms(&specs);
        assert!(!forms.is_empty());
        for form in &forms {
            assert!(form.iter().all(|k| !specs[*k].held || !specs[*k].shape), "{} {form:?}", effect.id);
            let acts = |k: &usize| !specs[*k].shape;
            let shapes_alone = specs.iter().all(|s| s.shape);
            let switch = specs.iter().all(|s| s.held);
            assert!(shapes_alone || switch || form.iter().any(acts), "{} {form:?}", effect.id);
            assert_eq!(forms.iter().filter(|f| *f == form).count(), 1, "{} {form:?} twice", effect.id);
        }
        // Between them they leave nothing of the effect out.
        let all = |k: usize| specs[k].held || forms.iter().any(|f| f.contains(&k));
        let left: Vec<_> = (0..specs.len()).filter(|k| !all(*k)).map(|k| specs[k].name).collect();
        assert!(left.is_empty() || effect.id == "torque_ripple_cogging", "{} {left:?}", effect.id);
    }
}

#[test]
fn an_effect_of_no_strength_changes_nothing() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL {
            let specs = (effect.parameters)(&bench.scale);
            let values: Vec<f64> = specs.iter().map(|s| if s.shape { s.start } else { 0.0 }).collect();
            let change = bench.difference(&bench.respond(&[(effect, &values)]).rows, &bench.base);
            failures.unless(change < 1e-9, || format!("{} {}: {change}", bench.name, effect.id));
        }
    }
}

#[test]
fn starts_are_visible_and_small() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in added() {
            let specs = (effect.parameters)(&bench.scale);
            let response = bench.respond(&[(effect, &starting(&specs))]).rows;
            let change = bench.difference(&response, &bench.base);
            failures.unless((0.0005..0.3).contains(&change), || {
                format!("{} {}: {change}", bench.name, effect.id)
            });
        }
    }
}

#[test]
fn each_strength_alone_is_visible() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL.iter().filter(|e| e.id != "drive_freewheels") {
            let specs = (effect.parameters)(&bench.scale);
            // The first level is rest: what acts then alone is not seen.
            let at_rest = |s: &Spec| s.acts.is_some_and(|a| a.from_s + a.length_s <= LEVEL_S);
            for (k, spec) in specs.iter().enumerate().filter(|(_, s)| !s.shape && !s.held && !at_rest(s)) {
                let values: Vec<f64> = specs
                    .iter()
                    .enumerate()
                    .map(|(j, s)| if s.shape || j == k { s.start } else { 0.0 })
                    .collect();
                let rows = bench.respond(&[(effect, &values)]).rows;
                let turned = |(a, b): (&Sensed, &Sensed)| (a.shaft_angle_rad - b.shaft_angle_rad).abs();
                let turned = rows.iter().zip(&bench.base).map(turned).fold(0.0, f64::max);
                let change = bench.difference(&rows, &bench.base).max(1e-3 * turned);
                failures.unless(change > 1e-5, || {
                    format!("{} {} {}: {change}", bench.name, effect.id, spec.name)
                });
            }
        }
    }
}

#[test]
fn responses_are_continuous_in_the_parameters() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in added() {
            let specs = (effect.parameters)(&bench.scale);
            let start = starting(&specs);
            let from = bench.respond(&[(effect, &start)]).rows;
            let reach = bench.difference(&from, &bench.base);
            for (k, spec) in specs.iter().enumerate().filter(|(_, s)| !s.held) {
                let step = 1e-3 * spec.start.abs().max(1e-3 * (spec.high - spec.low));
                let at = |h: f64| {
                    let mut values = start.clone();
                    values[k] += h;
                    bench.difference(&bench.respond(&[(effect, &values)]).rows, &from)
                };
                // Both halves of a small step count: no jump hides in either.
                let (whole, half) = (at(step), at(0.5 * step));
                failures.unless(whole < 0.1 * reach + 1e-7, || {
                    format!("{} {} {}: {whole}", bench.name, effect.id, spec.name)
                });
                failures.unless(half < 0.75 * whole + 1e-8, || {
                    format!("{} {} {}: {half} of {whole}", bench.name, effect.id, spec.name)
                });
            }
        }
    }
}

#[test]
fn every_bound_and_every_start_stays_finite() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL {
            let specs = (effect.parameters)(&bench.scale);
            let mut tries = (effect.starts)(&bench.scale);
            tries.push(specs.iter().map(|s| s.low).collect());
            tries.push(specs.iter().map(|s| s.high).collect());
            for k in 0..specs.len() {
                for bound in [specs[k].low, specs[k].high] {
                    let mut values = starting(&specs);
                    values[k] = bound;
                    tries.push(values);
                }
            }
            // Many alike parameters: the first few stand for all.
            for values in tries.iter().take(24) {
                let rows = bench.respond(&[(effect, values)]).rows;
                let finite = rows
                    .iter()
                    .all(|s| (s.thrust_n + s.shaft_speed_rad_s + s.flow_m_s + s.torque_n_m).is_finite());
                failures.unless(finite, || format!("{} {} {values:?}", bench.name, effect.id));
            }
        }
    }
}

#[test]
fn sensors_never_move_the_shaft() {
    let mut failures = Failures::default();
    for bench in benches() {
        for effect in ALL.iter().filter(|e| e.path == Path::Sensor) {
            let mut values = starting(&(effect.parameters)(&bench.scale));
            if effect.id == "torque_channel_bias" {
                // A drive that regulates a wrong zero, or is told one, is no sensor alone.
                (values[0], values[3]) = (0.0, 0.0);
            }
            let still = bench.truth(&[(effect, &values)]) == bench.base_truth;
            failures.unless(still, || format!("{} {}", bench.name, effect.id));
        }
    }
}

#[test]
fn all_small_effects_work_together_in_pairs() {
    let bench = bench("work class", WORK);
    for pair in added().collect::<Vec<_>>().windows(2) {
        let values = pair.iter().map(|e| starting(&(e.parameters)(&bench.scale))).collect::<Vec<_>>();
        let rows = bench.respond(&[(pair[0], &values[0]), (pair[1], &values[1])]).rows;
        let change = bench.difference(&rows, &bench.base);
        assert!(change.is_finite() && change < 0.6, "{} and {}: {change}", pair[0].id, pair[1].id);
    }
}

#[test]
fn a_voltage_drive_sags_below_its_command() {
    let mut bench = bench("voltage drive", WORK);
    bench.rig.amplifier.kind = AmplifierKind::Voltage;
    bench.stimulus.ticks.iter_mut().for_each(|t| t.command *= 10.0);
    bench.base = bench.respond(&[]).rows;
    let sag = effects::find("supply_sag").unwrap();
    let rows = bench.respond(&[(sag, &[1.0, 0.0, 1.0])]).rows;
    let end = |rows: &[Sensed]| rows[390].shaft_speed_rad_s.abs();
    assert!(end(&rows) < 0.99 * end(&bench.base) && end(&rows) > 0.8 * end(&bench.base));
}

#[test]
fn axial_flow_dynamics_makes_model_2_of_the_static_models() {
    let bench = &benches()[0];
    let effect = effects::find("axial_flow_dynamics").unwrap();
    let values = starting(&(effect.parameters)(&bench.scale));
    let run = |model: ModelName, effects: &[(&Descriptor, &[f64])]| {
        let parameters = Parameters::stated(&bench.rig);
        let mut plant = Plant::new(model, &bench.rig, &parameters, effects, bench.scale.tick_s);
        (0..500)
            .map(|k| {
                plant.step(&Tick { time_s: k as f64 * bench.scale.tick_s, command: 5.0, ..Tick::default() });
                plant.sensed()
            })
            .collect::<Vec<_>>()
    };
    let wanted = run(ModelName::Model2, &[]);
    for model in [ModelName::Model0, ModelName::Model1] {
        let change = bench.difference(&run(model, &[(effect, &values)]), &wanted);
        assert!(change < 1e-12, "{model}: {change}");
        assert!(bench.difference(&run(model, &[]), &wanted) > 1e-3, "{model}");
    }
}

#[test]
fn what_does_the_same_together_is_in_the_catalogue() {
    for effect in ALL {
        let known = |id: &&str| *id != effect.id && effects::find(id).is_some();
        for same in effect.same_as {
            assert_ne!(same.len(), 1, "{}: two names of one effect", effect.id);
            assert!(same.iter().all(known), "{}: {same:?}", effect.id);
        }
    }
}
