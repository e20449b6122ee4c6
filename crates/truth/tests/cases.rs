//! Cases of the proof: the same seed gives the same bytes, sizes are as asked, and nothing of the
//! answer stands in what is handed to `diagnose`.

use kort_truth::{Case, CaseKind, MachineKind, Selection, case, families};

fn single(effect: &str, strength: f64, seed: u64) -> Case {
    let selection =
        Selection { effect: Some(effect.into()), strength: Some(strength), ..Selection::default() };
    case(CaseKind::Single, seed, &selection)
}

#[test]
fn kind_and_seed_alone_make_a_case() {
    let plain = Selection::default();
    for kind in [CaseKind::Clean, CaseKind::Pair] {
        let (a, b) = (case(kind, 3, &plain), case(kind, 3, &plain));
        assert!(a == b, "{kind:?}");
        let other = case(kind, 4, &plain);
        assert!(a.recording_csv != other.recording_csv && a.rig_toml != other.rig_toml);
    }
    let clean = case(CaseKind::Clean, 3, &plain).answer;
    assert!(clean.effects.is_empty() && clean.confounded.is_empty());
}

#[test]
fn the_wanted_size_is_made_on_the_best_channel_and_a_refit_leaves_a_part() {
    for (effect, wanted) in
        [("viscous_friction", 0.03), ("rotational_flow", 0.03), ("thrust_sensor_lag", 0.02)]
    {
        let case = single(effect, wanted, 11);
        let [hidden] = case.answer.effects.as_slice() else { panic!("{:?}", case.answer) };
        assert_eq!((hidden.effect.as_str(), hidden.wanted), (effect, wanted));
        let ratio = hidden.share_of_full_scale / wanted;
        assert!((0.9..1.1).contains(&ratio), "{effect}: {ratio} of what was wanted");
        assert!((0.0..=1.001 * hidden.share_of_full_scale).contains(&hidden.visible_after_refit));
    }
}

#[test]
fn several_effects_are_several_and_no_two_the_same() {
    for seed in 1..3 {
        let answer = case(CaseKind::Several, seed, &Selection::default()).answer;
        assert!((3..=6).contains(&answer.effects.len()), "{answer:?}");
        for (place, effect) in answer.effects.iter().enumerate() {
            assert!(answer.effects[..place].iter().all(|other| other.effect != effect.effect), "{answer:?}");
        }
    }
}

#[test]
fn confounded_cases_list_the_hidden_effect_among_its_rivals() {
    for seed in 0..5 {
        let answer = case(CaseKind::Confounded, seed, &Selection::default()).answer;
        assert!(answer.confounded.len() >= 2, "{answer:?}");
        assert!(answer.confounded.contains(&answer.effects[0].effect.as_str()), "{answer:?}");
    }
}

#[test]
fn what_lies_outside_has_no_catalogue_name_and_is_another_each_time() {
    let mut forms = Vec::new();
    for seed in 0..4 {
        let answer = case(CaseKind::Outside, seed, &Selection::default()).answer;
        let hidden = &answer.effects[0];
        assert!(families::find(&hidden.effect).is_none(), "{hidden:?}");
        assert!(!forms.contains(&hidden.form), "{hidden:?}");
        forms.push(hidden.form.clone());
    }
}

#[test]
fn selections_hold() {
    let selection = Selection {
        machine: Some(MachineKind::Dry),
        families: vec!["coulomb_friction".into(), "amplifier_lag".into(), "clock_skew".into()],
        without: vec!["clock_skew".into()],
        without_noise: vec!["white".into()],
        ..Selection::default()
    };
    for seed in 0..4 {
        let answer = case(CaseKind::Pair, seed, &selection).answer;
        assert!(answer.dry && answer.noises.iter().all(|noise| noise.noise != "white"), "{answer:?}");
        let mut ids: Vec<&str> = answer.effects.iter().map(|e| e.effect.as_str()).collect();
        ids.sort_unstable();
        assert_eq!(ids, ["amplifier_lag", "coulomb_friction"]);
    }
}

#[test]
fn the_answer_stays_sealed() {
    for kind in CaseKind::ALL {
        let case = case(kind, 21, &Selection::default());
        for text in [&case.recording_csv[..200], &case.rig_toml] {
            let ids = families::ALL.iter().map(|family| family.id);
            let ids = ids.filter(|id| *id != "viscous_friction");
            for word in ids.chain(["single", "pair", "confounded", "outside", "seed", "hidden"]) {
                assert!(!text.contains(word), "{}: `{word}` gives the answer away: {text}", kind.name());
            }
        }
        // Numbers and empty cells below one header row: nothing can be written between them.
        let mut lines = case.recording_csv.lines();
        let width = lines.next().unwrap().split(',').count();
        let mut last = f64::NEG_INFINITY;
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            assert!(cells.len() == width && cells.iter().all(|c| c.is_empty() || c.parse::<f64>().is_ok()));
            let time_s: f64 = cells[0].parse().unwrap();
            assert!(time_s > last, "{}: {time_s} after {last}", kind.name());
            last = time_s;
        }
    }
}
