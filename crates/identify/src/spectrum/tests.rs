use super::*;

#[test]
fn bands_cover_every_line_once_and_widen() {
    for n in [1, 2, 7, 600, 6500] {
        let ranges = band_ranges(n);
        assert_eq!(ranges[0], 0..1);
        assert!(ranges.windows(2).all(|w| w[0].end == w[1].start), "{ranges:?}");
        assert_eq!(ranges.last().unwrap().end, n);
    }
    let ranges = band_ranges(6500);
    assert!(ranges.len() < 22, "{}", ranges.len());
}

#[test]
fn lines_about_a_frequency_count_together_over_recordings_of_one_channel() {
    let band = |hz: f64, lines: usize| Band {
        lines: 0..lines,
        hz,
        alike: lines,
        signal: 0.0,
        quantisation: 0.0,
        row_s: 0.01,
        stale_s: 0.0,
        continues: true,
        rest: false,
    };
    let place = |recording, response, constant| Place { recording, response, constant };
    let (speed, thrust) = (Response::ShaftSpeed, Response::Thrust);
    let mut bands =
        vec![band(0.01, 1), band(1.0, 20), band(0.05, 1), band(1.1, 30), band(1.0, 20), band(1.4, 5)];
    let places = [
        place(0, speed, true),
        place(0, speed, false),
        place(1, speed, true),
        place(1, speed, false),
        place(1, thrust, false),
        place(0, speed, false),
    ];
    count_alike(&mut bands, &places);
    let alike: Vec<usize> = bands.iter().map(|band| band.alike).collect();
    assert_eq!(alike, [2, 50, 2, 50, 20, 5]);
}

/// A speed and an angle of one shaft, each with noise of such a size.
fn speed_and_angle(of_speed: f64, of_angle: f64) -> Prepared {
    let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";
    let rig = kort_thruster::rig::Rig::from_toml(rig).unwrap();
    // White: a mixed counter (Steele et al. 2014, SplitMix64).
    let off = |k: usize, size: f64| {
        let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        size * ((z >> 33) as f64 / f64::from(1_u32 << 30) - 1.0)
    };
    let rows = 0..2000;
    let columns = [
        ("current_cmd_a", rows.clone().map(|k| (0.05 * k as f64).sin()).collect::<Vec<f64>>()),
        (
            "shaft_speed_rad_s",
            rows.clone().map(|k| 20.0 * (0.01 * k as f64).cos() + off(k, of_speed)).collect(),
        ),
        (
            "shaft_angle_rad",
            rows.clone().map(|k| 20.0 * (0.01 * k as f64).sin() + off(k + 7000, of_angle)).collect(),
        ),
    ];
    let series = crate::data::Series {
        name: "log".into(),
        time_s: rows.map(|k| 0.01 * k as f64).collect(),
        columns: columns.map(|(name, values)| (name.to_owned(), values)).into(),
    };
    Prepared::new(&series, &rig, false).unwrap()
}

#[test]
fn speed_and_angle_show_one_motion_each_where_its_noise_is_the_lower() {
    let slow = |of_speed: f64, of_angle: f64| {
        let all = [speed_and_angle(of_speed, of_angle)];
        let spectrum = Spectrum::new(&all, &[vec![false; 2000]]);
        let lines = spectrum.frames[0].iter().map(Frame::lines_of_other).max().unwrap();
        lines as f64 / 2000.0 * 50.0
    };
    // Noise of 1 mrad makes 0.1 rad/s times 2 sin(pi f / 100 Hz) of a rate over 10 ms.
    let alike = slow(0.1, 1e-3);
    assert!((11.0..25.0).contains(&alike), "{alike} Hz");
    assert_eq!(slow(1.0, 1e-3), 50.0, "the angle throughout");
    let low = slow(0.01, 1e-3);
    assert!((1.0..2.6).contains(&low), "{low} Hz");
}

#[test]
fn what_speed_and_angle_err_by_comes_back_channel_by_channel() {
    let all = [speed_and_angle(0.1, 1e-3)];
    let spectrum = Spectrum::new(&all, &[vec![false; 2000]]);
    let stack: Stack = all.iter().map(|r| r.channels.iter().map(|c| c.values.clone()).collect()).collect();
    let powers = spectrum.powers(&spectrum.transform(&stack));
    for (channel, variance) in all[0].channels.iter().zip(&spectrum.variances(&powers)[0]) {
        let square = channel.values.iter().map(|v| v * v).sum::<f64>() / channel.values.len() as f64;
        assert!((variance / square - 1.0).abs() < 0.05, "{:?}: {variance}, {square}", channel.response);
    }
}

#[test]
fn rates_of_a_counted_angle_err_little_where_they_are_slow() {
    let (n, count_rad) = (4096, 0.01);
    let angle = |k: usize| 3.0 * (k as f64 * 0.0031).sin() + 0.0217 * k as f64;
    let off = |k: usize| (angle(k) / count_rad).round() * count_rad - angle(k);
    let mut lines: Vec<f64> = (0..n).map(|k| off(k + 1) - off(k)).collect();
    DctPlanner::new().plan_dct2(n).process_dct2(&mut lines);
    for range in band_ranges(n).into_iter().filter(|r| r.len() > 10) {
        let scale = 2.0 / n as f64 / range.len() as f64;
        let power = scale * lines[range.clone()].iter().map(|v| v * v).sum::<f64>();
        let middle = 0.5 * (range.start + range.end - 1) as f64 / (2.0 * n as f64);
        let told = count_rad.powi(2) / 12.0 * differenced(Response::ShaftAngle, middle, n);
        assert!((0.4..2.5).contains(&(power / told)), "{range:?}: {power:e}, told {told:e}");
    }
    assert_eq!(differenced(Response::ShaftSpeed, 0.01, n), 1.0);
}

#[test]
fn a_coarse_converter_has_its_step_and_a_fine_one_hardly_any() {
    let coarse: Vec<f64> =
        (0..1000).map(|k| (f64::from(k) * 0.37).sin()).map(|v| (v / 0.1).round() * 0.1).collect();
    assert!((quantum(&coarse) - 0.1).abs() < 1e-9);
    let fine: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.37).sin()).collect();
    assert!(quantum(&fine) < 0.01);
}
