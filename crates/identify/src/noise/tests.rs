use proptest::prelude::*;

use super::*;

const CRITERION: Criterion =
    Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 30.0, timing_s: 0.001 };

fn bands() -> Vec<Band> {
    (0..12)
        .map(|k| Band {
            lines: 10 * k..10 * k + 10,
            hz: 0.01 * 1.585_f64.powi(k as i32),
            alike: 10,
            signal: if k == 3 { 1.0 } else { 1e-12 },
            quantisation: 0.0,
            row_s: 0.01,
            stale_s: 0.0,
            continues: k < 11,
            rest: false,
        })
        .collect()
}

#[test]
fn the_form_error_falls_with_the_square_of_frequency_above_the_signal_and_is_none_below() {
    let floor = Floor::of_signal(&bands(), &CRITERION);
    assert!(floor.levels()[2] < 1e-12, "{:?}", floor.levels());
    assert!((floor.levels()[3] / 1e-4 - 1.0).abs() < 0.01);
    assert!((floor.levels()[5] / floor.levels()[3] * 1.585_f64.powi(4) - 1.0).abs() < 0.01);
}

#[test]
fn what_is_read_at_rest_weighs_by_what_it_scatters() {
    let rest = Band {
        lines: 0..1,
        alike: 1,
        signal: 0.0,
        quantisation: 0.04,
        continues: false,
        rest: true,
        ..bands()[0].clone()
    };
    let misfit = |bands: &[Band], mean: f64| {
        let floor = Floor::of_signal(bands, &CRITERION);
        let powers = vec![mean * mean; bands.len()];
        Noise::of(bands, &powers, &floor, &CRITERION).misfit
            - Noise::of(bands, &vec![0.0; bands.len()], &floor, &CRITERION).misfit
    };
    // A mean of ten scatters is a forgotten tare, one of half a scatter is nothing.
    let gain = |mean: f64| misfit(std::slice::from_ref(&rest), mean);
    assert!((gain(2.0) - 30.0 * 101.0_f64.ln()).abs() < 1e-6, "{}", gain(2.0));
    assert!(gain(0.1) < 7.0, "{}", gain(0.1));
    // Two recordings are no more facts than one.
    let two = [Band { alike: 2, ..rest.clone() }, Band { lines: 1..2, alike: 2, ..rest.clone() }];
    assert!((misfit(&two, 2.0) - gain(2.0)).abs() < 1e-6);
}

#[test]
fn stamps_of_a_fast_log_are_doubted_by_no_more_than_a_row() {
    let level = |row_s: f64| {
        let bands: Vec<Band> = bands().into_iter().map(|b| Band { signal: 1.0, row_s, ..b }).collect();
        Floor::of_signal(&bands, &Criterion { form_error: 0.0, ..CRITERION }).levels[11]
    };
    assert!((level(0.1) / level(0.01) - 1.0).abs() < 1e-9, "a slow log: what the criterion says");
    assert!(
        (level(0.01) / level(1e-4) / 1200.0 - 1.0).abs() < 1e-6,
        "a fast one: a row over the root of twelve"
    );
}

#[test]
fn what_is_left_of_a_mismatch_below_a_share_hardly_counts_and_the_rest_does() {
    let mut bands = bands();
    bands[5].signal = 1.0;
    let (mut mismatch, facts) = (vec![1e-6; 12], CRITERION.facts(&bands[5]));
    mismatch[5] = 1.0;
    let floor = Floor::of_signal(&bands, &CRITERION).explaining(&bands, &mismatch, &CRITERION);
    let misfit = |left: f64| {
        let mut powers = vec![1e-6; 12];
        powers[5] = left;
        Noise::of(&bands, &powers, &floor, &CRITERION).misfit
    };
    let share = CRITERION.own_form_error.powi(2);
    assert!(misfit(1.0) - misfit(share) > facts * (0.9 / share).ln());
    assert!(misfit(share) - misfit(0.01 * share) < 1.01 * facts);
    assert!(misfit(0.01 * share) < misfit(share), "less error never costs more");
    let away = vec![1e3; 12];
    let most = Floor::of_signal(&bands, &CRITERION).explaining(&bands, &away, &CRITERION);
    assert!(
        (most.levels()[5] - floor.levels()[5]).abs() < 1e-12,
        "no more than the signal is to be explained"
    );
}

#[test]
fn the_lower_of_two_floors_holds_band_by_band() {
    let signal: Vec<Band> = bands().into_iter().map(|band| Band { signal: 1.0, ..band }).collect();
    let floor = Floor::of_signal(&signal, &CRITERION);
    let (low, high): (Vec<f64>, Vec<f64>) =
        (0..12).map(|k| if k < 6 { (0.0, 1.0) } else { (1.0, 0.0) }).unzip();
    let held = |mismatch: &[f64]| floor.explaining(&signal, mismatch, &CRITERION);
    assert_eq!(held(&low).or_lower(&held(&high)), floor);
}

#[test]
fn a_constant_error_hides_in_noise_only_as_far_as_a_random_walk_goes() {
    let floor = Floor::of_signal(&bands(), &CRITERION);
    let mut powers = vec![1e-6; 12];
    let quiet = Noise::of(&bands(), &powers, &floor, &CRITERION);
    powers[0] = 1e-2;
    let biased = Noise::of(&bands(), &powers, &floor, &CRITERION);
    for pair in biased.level.windows(2) {
        assert!(pair[0] < pair[1] * 1.585_f64.powi(2) * 1.001, "{:?}", biased.level);
    }
    // Free, the band's own level would cost 7.5 ln 1e4 = 69.
    assert!(biased.misfit > quiet.misfit + 2.0 * 69.0, "{} after {}", biased.misfit, quiet.misfit);
}

#[test]
fn a_walk_costs_no_more_than_white_noise_of_its_own_level() {
    let floor = Floor::of_signal(&bands(), &CRITERION);
    let powers: Vec<f64> = bands().iter().map(|b| 1e-6 / (b.hz * b.hz)).collect();
    let walk = Noise::of(&bands(), &powers, &floor, &CRITERION);
    for (level, power) in walk.level.iter().zip(&powers) {
        assert!((level / power - 1.0).abs() < 1e-3, "{level} for {power}");
    }
}

proptest! {
    #[test]
    fn less_error_never_costs_more(
        decades in prop::collection::vec(-9.0..-3.0_f64, 12),
        floors in prop::collection::vec(-9.0..-3.0_f64, 12),
        less in 0.0..1.0_f64,
        k in 0..12_usize,
    ) {
        let levels = floors.iter().map(|d| 10.0_f64.powf(*d)).collect();
        let floor = Floor { levels, doubt: vec![0.0; 12], own: vec![0.0; 12], white: vec![0.0; 12] };
        let mut powers: Vec<f64> = decades.iter().map(|d| 10.0_f64.powf(*d)).collect();
        let before = Noise::of(&bands(), &powers, &floor, &CRITERION).misfit;
        powers[k] *= less;
        let after = Noise::of(&bands(), &powers, &floor, &CRITERION).misfit;
        prop_assert!(after <= before + 1e-9, "band {}: {} after {}", k, after, before);
    }
}

#[test]
fn an_error_below_white_noise_shows_by_what_many_lines_tell() {
    let mut wide = bands();
    for (k, band) in wide.iter_mut().enumerate() {
        (band.lines, band.alike) = (1000 * k..1000 * k + 1000, 1000);
    }
    let exact = Criterion { form_error: 0.0, timing_s: 0.0, ..CRITERION };
    let plain = Floor::of_signal(&wide, &exact);
    let noise = vec![1e-6; 12];
    let white = plain.explaining(&wide, &noise, &exact);
    let mut powers = noise.clone();
    powers[8] = 1.5e-6;
    let told = |floor: &Floor| {
        let misfit = |powers: &[f64]| Noise::of(&wide, powers, floor, &exact).misfit;
        misfit(&powers) - misfit(&noise)
    };
    let facts = exact.facts(&wide[8]);
    assert!(
        (told(&plain) / facts - 1.5_f64.ln()).abs() < 0.02,
        "no noise known: as much as a structural error"
    );
    assert!(
        (told(&white) / facts - (1.0 + 0.5 * 1000.0 / facts).ln()).abs() < 0.3,
        "{}",
        told(&white) / facts
    );
}

#[test]
fn what_is_excused_at_a_frequency_is_no_noise_beside_it() {
    let loud: Vec<Band> = bands().into_iter().map(|band| Band { signal: 1e-2, ..band }).collect();
    let mut mismatch = vec![1e-9; 12];
    mismatch[0] = 1e-2;
    let exact = Criterion { form_error: 0.0, timing_s: 0.0, ..CRITERION };
    let floor = Floor::of_signal(&loud, &exact).explaining(&loud, &mismatch, &exact);
    let levels = |constant: f64| {
        let mut powers = vec![1e-9; 12];
        powers[0] = constant;
        Noise::of(&loud, &powers, &floor, &exact).level
    };
    assert!(levels(1e-5)[1] < 1.1e-9, "within the share of the mismatch that its name may leave");
    assert!(levels(1e-2)[1] > 1e-4, "beyond it: a walk");
}

#[test]
fn many_lines_count_as_few_facts_in_however_many_recordings() {
    let mut wide = bands();
    wide.truncate(1);
    wide[0] = Band { continues: false, lines: 0..100_000, alike: 100_000, ..wide[0].clone() };
    let told = |bands: &[Band]| {
        let floor = Floor::of_signal(bands, &CRITERION);
        let misfit = |power| Noise::of(bands, &vec![power; bands.len()], &floor, &CRITERION).misfit;
        misfit(1e-2) - misfit(1e-4)
    };
    assert!((told(&wide) - 30.0 * 100.0_f64.ln()).abs() < 0.1);
    let one_of_four = Band { alike: 400_000, ..wide[0].clone() };
    assert!((told(&vec![one_of_four; 4]) - told(&wide)).abs() < 0.1);
}

#[test]
fn what_drives_is_in_doubt_no_further_than_the_mismatch_of_any_channel_shows() {
    let two: Vec<Band> = bands().into_iter().chain(bands()).collect();
    let doubted = Floor::of_signal(&two, &CRITERION).with_doubt(&[1e-2; 24]);
    let kept = |first: f64, second: f64| {
        let mismatch: Vec<f64> =
            std::iter::repeat_n(first, 12).chain(std::iter::repeat_n(second, 12)).collect();
        doubted.explaining(&two, &mismatch, &CRITERION).doubt()[0] / 1e-2
    };
    assert_eq!(kept(1.0, 1.0), 1.0, "all of it may be real");
    assert_eq!(kept(1e-2, 1e-2), 1.0);
    let facts: f64 = bands().iter().map(|band| CRITERION.facts(band)).sum();
    assert!((kept(1e-4, 1.0) / (1e-2 * (1.0 + 2.0 * (4.0 / facts).sqrt())) - 1.0).abs() < 1e-9);
    assert_eq!(kept(1e-4, 1.0), kept(1.0, 1e-4));
    let plain = Floor::of_signal(&two, &CRITERION);
    assert_eq!(
        plain.explaining(&two, &[0.0; 24], &CRITERION).levels(),
        plain.levels(),
        "nothing was in doubt"
    );
}
