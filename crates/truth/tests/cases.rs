//! Cases of the proof: the same seed gives the same bytes, the wanted strength is there, and nothing
//! of the answer stands in what is handed to `diagnose`.

use kort_truth::effects::Effect;
use kort_truth::{Case, CaseKind, Selection, case};

/// One effect at a wanted strength, on one lumped blade section.
fn single(effect: Effect, strength: f64, seed: u64) -> Case {
    let selection =
        Selection { effect: Some(effect.id().into()), strength: Some(strength), distributed: Some(false) };
    case(CaseKind::Single, seed, &selection)
}

#[test]
fn kind_and_seed_alone_make_a_case() {
    let plain = Selection::default();
    let (a, b) = (case(CaseKind::Clean, 3, &plain), case(CaseKind::Clean, 3, &plain));
    assert!(a == b);
    let other = case(CaseKind::Clean, 4, &plain);
    assert!(a.recording_csv != other.recording_csv && a.rig_toml != other.rig_toml);
    assert!(a.answer.effects.is_empty() && a.answer.confounded.is_empty());
}

#[test]
fn the_wanted_strength_is_made_on_the_best_channel() {
    for (effect, wanted) in
        [(Effect::ViscousFriction, 0.03), (Effect::RotationalFlow, 0.03), (Effect::ThrustSensorLag, 0.012)]
    {
        let case = single(effect, wanted, 11);
        let [hidden] = case.answer.effects.as_slice() else { panic!("{:?}", case.answer) };
        assert_eq!((hidden.effect, hidden.path, hidden.wanted), (effect.id(), effect.path(), wanted));
        let ratio = hidden.share_of_full_scale / wanted;
        assert!((0.9..1.1).contains(&ratio), "{}: {ratio} of what was wanted", hidden.effect);
        // What a re-fit leaves is a part of it.
        assert!((0.0..=1.001 * hidden.share_of_full_scale).contains(&hidden.visible_after_refit));
    }
}

#[test]
fn confounded_cases_list_the_hidden_effect_among_its_rivals() {
    for seed in 0..5 {
        let answer = case(CaseKind::Confounded, seed, &Selection::default()).answer;
        assert!(answer.confounded.len() >= 2, "{answer:?}");
        assert!(answer.confounded.contains(&answer.effects[0].effect), "{answer:?}");
    }
}

#[test]
fn the_answer_stays_sealed() {
    let catalogue: Vec<&str> = Effect::ALL.iter().map(|e| e.id()).collect();
    for kind in CaseKind::ALL {
        let case = case(kind, 21, &Selection::default());
        for text in [&case.recording_csv[..200], &case.rig_toml] {
            for word in catalogue.iter().chain(&["single", "pair", "confounded", "outside", "seed", "hidden"])
            {
                assert!(!text.contains(word), "{}: `{word}` gives the answer away: {text}", kind.name());
            }
            for hidden in &case.answer.effects {
                assert!(!text.contains(hidden.effect), "{text}");
            }
        }
        // Numbers and empty cells below one header row: nothing can be written between them.
        let mut lines = case.recording_csv.lines();
        let width = lines.next().unwrap().split(',').count();
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            assert!(cells.len() == width && cells.iter().all(|c| c.is_empty() || c.parse::<f64>().is_ok()));
        }
    }
}

#[test]
fn the_log_keeps_its_instants_and_the_flow_meter_its_rate() {
    let case = case(CaseKind::Clean, 8, &Selection::default());
    let mut lines = case.recording_csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let flow = header.iter().position(|c| *c == "flow_m_s").unwrap();
    for (row, line) in lines.enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let time_s: f64 = cells[0].parse().unwrap();
        assert!((time_s - 0.01 * row as f64).abs() < 1e-9, "row {row}: {time_s} s");
        assert_eq!(cells[flow].is_empty(), row % 5 != 0, "row {row}: 20 Hz of 100 Hz");
    }
}
