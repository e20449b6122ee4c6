//! Steps of the search on a motor that rubs and whose speed is read late.

use std::sync::Arc;

use kort_identify::data::Series;
use kort_identify::hypothesis::Member;
use kort_identify::setup::Setup;
use kort_thruster::effects::{
    Descriptor, coulomb_friction, direction_dependent_friction, encoder_filter_lag,
    position_dependent_friction, torque_ripple_cogging,
};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use super::{ITERATIONS, Search, Set};
use crate::constants::Constants;
use crate::left::at_its_best;
use crate::probe::Promise;
use crate::screen;

const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 5e-6, tol = 0.5 }\n\
                   torque_constant_nm_a = { value = 0.025, tol = 0.3 }\n[amplifier]\nkind = \"current\"\n";
/// Dry friction, N m, and lag of the speed's reading, s.
const FRICTION_N_M: f64 = 0.0025;
const LAG_S: f64 = 0.03;

/// Twenty seconds of a motor under measured current, logged at 200 Hz, whose magnets turn it so far by its angle.
fn recording(cogging_n_m: impl Fn(f64) -> f64) -> Series {
    let (inertia, kt, dt) = (5e-6, 0.025, 2.5e-4);
    let levels = [0.3, -0.35, 0.2, -0.3, 0.4, -0.25, 0.35, -0.4, 0.25, -0.2];
    let (mut speed, mut angle, mut shown) = (0.0_f64, 0.0, 0.0);
    let mut columns = vec![Vec::new(), Vec::new(), Vec::new()];
    let mut time_s = Vec::new();
    for k in 0..80_000_u32 {
        let t = f64::from(k) * dt;
        let current = levels[(t / 0.37) as usize % levels.len()] * (0.6 + 0.4 * (10.7 * t).sin());
        if k % 20 == 0 {
            let noise = 0.2 * (12.9898 * t * t).sin();
            [current, angle, shown + noise].iter().zip(&mut columns).for_each(|(v, c)| c.push(*v));
            time_s.push(t);
        }
        speed += (kt * current + cogging_n_m(angle)) / inertia * dt;
        speed = speed.signum() * (speed.abs() - FRICTION_N_M / inertia * dt).max(0.0);
        angle += speed * dt;
        shown += (speed - shown) / LAG_S * dt;
    }
    let names = ["current_a", "shaft_angle_rad", "shaft_speed_rad_s"];
    Series {
        name: "motor".into(),
        time_s,
        columns: names.map(str::to_owned).into_iter().zip(columns).collect(),
    }
}

/// A search with its baseline fitted.
fn with_search(effects: Vec<&'static Descriptor>, then: impl FnOnce(&mut Search)) {
    with_search_of(recording(|_| 0.0), effects, then);
}

fn with_search_of(series: Series, effects: Vec<&'static Descriptor>, then: impl FnOnce(&mut Search)) {
    let rig = Rig::from_toml(RIG).unwrap();
    let constants = Constants::built_in();
    let Setup { problem, baseline, .. } =
        Setup::new(&[series], &rig, ModelName::Model2, constants.criterion).unwrap();
    let mut search = Search::new(&problem, effects, &constants);
    search.fits.insert(Set::new(), problem.settle_from_stated(&baseline, ITERATIONS));
    then(&mut search);
}

#[test]
fn two_that_pay_together_are_found_without_either_alone() {
    with_search(vec![&coulomb_friction::DESCRIPTOR, &encoder_filter_lag::DESCRIPTOR], |search| {
        let nothing = Set::new();
        // Screened, and no single one fitted: nothing is within reach of a bar so low.
        assert!(search.expand(&nothing, f64::NEG_INFINITY).is_empty());
        let both = search.two_at_once(&nothing);
        assert_eq!(both, ["coulomb_friction", "encoder_filter_lag"]);
        assert!(search.cost(&both) < search.cost(&nothing) - 100.0);
        let fit = &search.fits[&both];
        let members = search.problem.members(&fit.hypothesis, &fit.values);
        let friction = members.iter().find(|m| m.effect.id == "coulomb_friction").unwrap().values[0];
        assert!((friction / FRICTION_N_M - 1.0).abs() < 0.25, "{friction} N m");
    });
}

#[test]
fn what_is_told_goes_as_far_as_it_can_and_is_held_to_what_it_was() {
    with_search(vec![&coulomb_friction::DESCRIPTOR, &encoder_filter_lag::DESCRIPTOR], |search| {
        let nothing = Set::new();
        search.expand(&nothing, f64::NEG_INFINITY);
        let both = search.two_at_once(&nothing);
        let (problem, baseline) = (search.problem, &search.fits[&nothing]);
        let bands = &problem.spectrum.bands;
        let floor =
            problem.floor.explaining(bands, &problem.spectrum.powers(&baseline.lines), &problem.criterion);
        let mut off = search.fits[&both].resume();
        let friction = off.free.iter().position(|free| free.name == "coulomb_torque_n_m").unwrap();
        off.start[friction] *= 1.3;
        let excused = problem.finish(problem.fit(&off, &Vec::new(), &floor, 0));
        let told = at_its_best(problem, &excused);
        assert!(told.lines.norm() < 0.7 * excused.lines.norm(), "{}", told.lines.norm());
        assert_eq!(told.floor, excused.floor);
        assert_eq!(
            at_its_best(problem, baseline).values,
            baseline.values,
            "a baseline stays as it was searched"
        );
    });
}

#[test]
fn what_acts_out_of_proportion_is_begun_from_every_start_where_more_than_noise_is_left() {
    with_search(vec![&coulomb_friction::DESCRIPTOR, &encoder_filter_lag::DESCRIPTOR], |search| {
        let nothing = Set::new();
        search.probes.insert(nothing.clone(), search.probe_all(&nothing));
        search.expand(&nothing, f64::NEG_INFINITY);
        let both = search.two_at_once(&nothing);
        let alone = vec!["coulomb_friction"];
        assert_eq!(search.every_start(&both), both);
        assert!(!search.fits.contains_key(&alone), "what both leave is noise: there is nothing to begin for");
        search.every_start(&nothing);
        assert!(search.cost(&alone) < search.cost(&nothing) - 100.0, "no screen led there");
    });
}

#[test]
fn orders_of_cogging_that_are_not_the_usual_ones_are_found_one_after_the_other() {
    let orders = [3.0, 5.0, 9.0];
    let cogging_n_m = move |angle: f64| orders.iter().map(|k| 4e-4 * (k * angle + k).sin()).sum();
    let effects: Vec<&'static Descriptor> = vec![
        &coulomb_friction::DESCRIPTOR,
        &encoder_filter_lag::DESCRIPTOR,
        &torque_ripple_cogging::DESCRIPTOR,
    ];
    with_search_of(recording(cogging_n_m), effects.clone(), |search| {
        let mut set = Set::new();
        for effect in effects {
            let from = search.fits[&set].clone();
            let member = Member::new(effect, &search.problem.scale);
            let hypothesis = from.hypothesis.with(&from.values, member, &search.problem.scale);
            set = super::with(&set, effect.id);
            search.fit_set(set.clone(), &hypothesis, &Vec::new());
        }
        search.reshape(&set);
        let fit = &search.fits[&set];
        let members = search.problem.members(&fit.hypothesis, &fit.values);
        let cogging = members.iter().find(|m| m.effect.id == "torque_ripple_cogging").unwrap();
        let mut found: Vec<f64> =
            cogging.values.chunks(5).filter(|order| order[1].hypot(order[2]) > 1e-4).map(|o| o[0]).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found, orders, "{:?}", cogging.values);
        assert!(
            search.cost_of(fit) > fit.cost() + 2.0 * 2.0 * 20.0_f64.ln(),
            "two choices among the usual orders"
        );
    });
}

#[test]
fn what_does_nothing_where_a_line_promises_much_is_looked_at_where_it_was_probed() {
    with_search(vec![&coulomb_friction::DESCRIPTOR], |search| {
        let parent = Arc::new(search.fits[&Set::new()].clone());
        let known = search.problem.about(&parent.lines, &parent.columns, &parent.hypothesis);
        let member = |friction_n_m: f64| {
            let whole = Member::new(&coulomb_friction::DESCRIPTOR, &search.problem.scale);
            let mut values = whole.values.clone();
            values[0] = friction_n_m;
            whole.at(values)
        };
        let looked = |scaled, probed, gain: f64| {
            let promise =
                Promise { cost: parent.cost() - gain, member: member(scaled), probed: member(probed) };
            let found = screen::look(search.problem, &parent, &known, promise).unwrap();
            found.hypothesis.effects[0].values[0]
        };
        let nothing = 1e-9 * FRICTION_N_M;
        assert!((looked(nothing, FRICTION_N_M, 500.0) / FRICTION_N_M - 1.0).abs() < 1e-9);
        assert!((looked(FRICTION_N_M, 2.0 * FRICTION_N_M, 10.0) / FRICTION_N_M - 1.0).abs() < 1e-9, "kept");
    });
}

#[test]
fn a_name_that_does_no_more_than_a_plainer_one_is_not_kept() {
    let (plain, bent) = (&coulomb_friction::DESCRIPTOR, &direction_dependent_friction::DESCRIPTOR);
    // A torque one way makes friction that differs by direction.
    for (one_way_n_m, more) in [(0.0, false), (5e-4, true)] {
        with_search_of(recording(|_| one_way_n_m), vec![plain, bent], |search| {
            let baseline = search.fits[&Set::new()].clone();
            let beside = |effect: &'static Descriptor, scale| {
                baseline.hypothesis.with(&baseline.values, Member::new(effect, scale), scale)
            };
            // The plainer one got lost on its way: it stands where it began.
            let start = beside(plain, &search.problem.scale);
            let lost = search.problem.fit(&start, &Vec::new(), &baseline.floor, 0);
            let lost = search.problem.finish(lost);
            search.keep(vec![plain.id], lost);
            let before = search.cost(&vec![plain.id]);
            search.fit_set(vec![bent.id], &beside(bent, &search.problem.scale), &baseline.columns);
            assert_eq!(search.fits.contains_key(&vec![bent.id]), more);
            assert_eq!(search.cost(&vec![plain.id]) < before - 50.0, !more, "found from there");
        });
    }
}

#[test]
fn another_way_begins_with_what_explains_something_else() {
    let [friction, bent, lag] = [
        &coulomb_friction::DESCRIPTOR,
        &position_dependent_friction::DESCRIPTOR,
        &encoder_filter_lag::DESCRIPTOR,
    ];
    with_search(vec![friction, bent, lag], |search| {
        let none = Set::new();
        let baseline = search.fits[&none].clone();
        search.probes.insert(none.clone(), search.probe_all(&none));
        for effect in [friction, bent, lag] {
            let member = Member::new(effect, &search.problem.scale);
            let hypothesis = baseline.hypothesis.with(&baseline.values, member, &search.problem.scale);
            let floor = &search.problem.floor;
            let fit = search.problem.settle(&hypothesis, &baseline.columns, floor, ITERATIONS);
            search.fits.insert(vec![effect.id], fit);
        }
        let (rubs, late) = (vec![friction.id], vec![lag.id]);
        assert_eq!(search.ways_beside(&rubs, &none).0, [friction.id, bent.id], "they explain the same");
        assert_eq!(search.ways_beside(&late, &none), (late.clone(), Some(rubs.clone())));
        assert_ne!(search.ways_beside(&late, &rubs).1, Some(rubs.clone()), "known to lead elsewhere");
        search.barred = late.clone();
        search.expand(&none, f64::INFINITY);
        assert!(!search.forward(&rubs).contains(&lag.id), "not to be added");
        search.barred = none;
        assert_eq!(search.elsewhere(late, &|_| ()), [friction.id, lag.id]);
    });
}

#[test]
fn what_hides_below_what_a_strong_name_is_excused_for_shows_at_a_second_look() {
    let effects: Vec<&'static Descriptor> = vec![
        &coulomb_friction::DESCRIPTOR,
        &encoder_filter_lag::DESCRIPTOR,
        &torque_ripple_cogging::DESCRIPTOR,
    ];
    for (cogging_n_m, shows) in [(5e-5, false), (1.5e-4, true)] {
        with_search_of(recording(|angle| cogging_n_m * (angle + 1.0).sin()), effects.clone(), |search| {
            let nothing = Set::new();
            search.hold(&nothing, "");
            search.probes.insert(nothing.clone(), search.probe_all(&nothing));
            search.expand(&nothing, f64::NEG_INFINITY);
            let both = search.two_at_once(&nothing);
            assert_eq!(search.forward(&both), both, "below what is excused");
            let (cost, fits) = (search.cost(&both), search.fits.len());
            let found = search.second_look(both.clone(), &|_| ());
            assert_eq!(found.contains(&"torque_ripple_cogging"), shows, "{found:?}");
            assert_eq!(search.fits.contains_key(&found) && search.cost(&found) < cost, shows);
            assert!(search.fits.len() >= fits, "every set that was fitted is weighed again");
        });
    }
}
