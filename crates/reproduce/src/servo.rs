//! Figures 9 and 10: Model 3 beside the stand under the speed servo (21).
//!
//! The stand is the composed plant: Model 2 behind the current amplifier, encoder counts
//! differenced at 500 Hz and filtered, the force sensor's filter. Model 3 gets the reference, as a
//! perfect servo would deliver it, and the servo's measured speed.

use kort_thruster::integrate::rk4;
use kort_thruster::models::{Model, Model3, ModelName, SpeedInput};
use kort_thruster::parameters::Parameter as P;
use kort_thruster::plant::{Plant, Tick};

use crate::figure::{Figure, Mark, Series};
use crate::steady::{EQ18, EQ20};
use crate::{Paper, Part, Row, settled};

/// Feedback gain, N m s: about 55 degrees of phase left behind the 10 ms filter and the 2 ms lag.
const FEEDBACK_NM_S: f64 = 0.5;
const PEAK_RAD_S: f64 = 60.0;

struct Run {
    time_s: Vec<f64>,
    reference_rad_s: Vec<f64>,
    speed_rad_s: Vec<f64>,
    measured_rad_s: Vec<f64>,
    thrust_n: Vec<f64>,
    model3_n: Vec<f64>,
    model3_measured_n: Vec<f64>,
}

/// Runs stand and Model 3 side by side; `sign` is -1 for (21) as the scan prints it.
fn run(paper: &Paper, duration_s: f64, sign: f64, reference: impl Fn(f64) -> f64) -> Run {
    let rate = paper.rig.sensors.control_rate_hz.unwrap_or(500.0);
    let dt = 1.0 / rate;
    let kt = paper.parameters.get(P::TorqueConstantNmA);
    let limit = paper.rig.amplifier.current_limit_a;
    let mut plant =
        Plant::new(ModelName::Model2, &paper.rig, &paper.parameters, &[], dt).with_encoder_quantised(true);
    let model = Model3::new(&paper.parameters);
    let (mut ideal, mut follows) = ([0.0], [0.0]);
    let mut out = Run {
        time_s: vec![],
        reference_rad_s: vec![],
        speed_rad_s: vec![],
        measured_rad_s: vec![],
        thrust_n: vec![],
        model3_n: vec![],
        model3_measured_n: vec![],
    };
    for k in 0..(duration_s * rate) as usize {
        let t = k as f64 * dt;
        let wanted = reference(t);
        let seen = plant.sensed();
        out.time_s.push(t);
        out.reference_rad_s.push(wanted);
        out.measured_rad_s.push(seen.shaft_speed_rad_s);
        out.speed_rad_s.push(plant.truth().shaft_speed_rad_s);
        out.thrust_n.push(seen.thrust_n);
        let thrust = |x: [f64; 1], om| model.load(x.into(), &SpeedInput::still(om)).thrust_n;
        out.model3_n.push(thrust(ideal, wanted));
        out.model3_measured_n.push(thrust(follows, seen.shaft_speed_rad_s));

        // (21); the reference thrust is that of the reference speed, (18).
        let feed_forward = EQ18 * wanted * wanted.abs() / EQ20;
        let current = (feed_forward + sign * FEEDBACK_NM_S * (wanted - seen.shaft_speed_rad_s)) / kt;
        plant.step(&Tick { time_s: t, command: current.clamp(-limit, limit), ..Tick::default() });
        let advance =
            |x, om: &dyn Fn(f64) -> f64| rk4(x, t, dt, |t, x| model.rates(x, &SpeedInput::still(om(t))));
        ideal = advance(ideal, &reference);
        let (a, b) = (seen.shaft_speed_rad_s, plant.sensed().shaft_speed_rad_s);
        follows = advance(follows, &|s| a + (b - a) * (s - t) / dt);
    }
    out
}

/// Root-mean-square difference over the largest magnitude of `a`, percent, after `from` samples.
fn difference_pct(a: &[f64], b: &[f64], from: usize) -> f64 {
    let square = a[from..].iter().zip(&b[from..]).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let peak = a[from..].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    100.0 * (square / (a.len() - from) as f64).sqrt() / peak
}

pub(crate) fn part(paper: &Paper) -> Part {
    let step_at = 1.0;
    let step = run(paper, 4.0, 1.0, |t| if t < step_at { 0.0 } else { PEAK_RAD_S });
    let sine = |hz: f64| move |t: f64| PEAK_RAD_S * (std::f64::consts::TAU * hz * t).sin();
    let slow = run(paper, 8.0, 1.0, sine(0.25));
    let fast = run(paper, 4.0, 1.0, sine(1.0));
    let printed_sign = run(paper, 4.0, -1.0, |t| if t < step_at { 0.0 } else { PEAK_RAD_S });

    let close = |id, what: &str, r: &Run| {
        let d = difference_pct(&r.thrust_n, &r.model3_measured_n, 0);
        Row::words(
            id,
            what,
            "corresponds closely",
            format!(
                "{d:.1} % of peak, r.m.s. ({:.1} % with the reference as input)",
                difference_pct(&r.thrust_n, &r.model3_n, 0)
            ),
            d < 5.0,
            "Within 5 % of the peak. Here the stand is itself a model, so this checks servo and measuring chain, not the water.",
        )
    };
    let tracks = |id, what: &str, r: &Run| {
        let d = difference_pct(&r.reference_rad_s, &r.speed_rad_s, 0);
        Row::words(
            id,
            what,
            "excellent tracking",
            format!("{d:.1} % of peak, r.m.s."),
            d < 10.0,
            "Within 10 % of the peak. What is left is the lag of the speed filter; the paper's gain, and so its lag, is not printed.",
        )
    };
    let peak = step.model3_n.iter().copied().fold(0.0, f64::max);
    let seen = step.thrust_n.iter().copied().fold(0.0, f64::max);
    let figure = |r: &Run, caption: &str| {
        [
            Figure::new(format!("{caption}: thrust"), "time [s]", "thrust [N]")
                .with(Series::new("stand", Mark::Line, &r.time_s, &r.thrust_n))
                .with(Series::new("Model 3, measured speed", Mark::Dashed, &r.time_s, &r.model3_measured_n))
                .with(Series::new("Model 3, reference", Mark::Dashed, &r.time_s, &r.model3_n)),
            Figure::new(format!("{caption}: shaft speed"), "time [s]", "shaft speed [rad/s]")
                .with(Series::new("measured", Mark::Line, &r.time_s, &r.measured_rad_s))
                .with(Series::new("reference", Mark::Dashed, &r.time_s, &r.reference_rad_s)),
        ]
    };
    Part {
        title: "Figures 9 and 10: Model 3 under the speed servo (21)",
        text: format!(
            "The servo at 500 Hz on encoder counts, kfb = {FEEDBACK_NM_S} N m s, a1 = 1/16.1; Model 3 beside it. The paper's \
             gain is not printed."
        ),
        rows: vec![
            Row::number(
                "fig9_speed",
                "60 rad/s step: settled speed [rad/s]",
                PEAK_RAD_S,
                settled(&step.speed_rad_s),
                2.0,
                "(21) has no integral: what is left is the feed-forward's error over kfb.",
            ),
            Row::number(
                "fig9_thrust",
                "60 rad/s step: settled thrust [N], against (18)",
                EQ18 * PEAK_RAD_S * PEAK_RAD_S,
                settled(&step.thrust_n),
                5.0,
                "",
            ),
            close("fig9_model3", "60 rad/s step: thrust of Model 3 against the stand", &step),
            Row::alone(
                "fig9_stand_peak",
                "60 rad/s step: peak over settled thrust on the stand [1]",
                seen / settled(&step.thrust_n),
                "The current limit and the shaft's inertia hold it below the next row. Printed as a curve only.",
            ),
            Row::alone(
                "fig9_ideal_peak",
                "60 rad/s step: peak over settled thrust of Model 3, ideal step [1]",
                peak / settled(&step.model3_n),
                "Still water meets a turning blade at its full pitch.",
            ),
            tracks("fig10_slow_tracking", "0.25 Hz: shaft speed against reference", &slow),
            close("fig10_slow_model3", "0.25 Hz: thrust of Model 3 against the stand", &slow),
            tracks("fig10_fast_tracking", "1 Hz: shaft speed against reference", &fast),
            close("fig10_fast_model3", "1 Hz: thrust of Model 3 against the stand", &fast),
            Row::words(
                "eq21_sign",
                "(21) with kfb (Om - Omr) as the scan prints it: settled speed",
                "tracks",
                format!("{:.0} rad/s for 60", settled(&printed_sign.speed_rad_s)),
                (settled(&printed_sign.speed_rad_s) / PEAK_RAD_S - 1.0).abs() < 0.02,
                "The printed sign is positive feedback; the runs above use kfb (Omr - Om).",
            ),
        ],
        figures: [figure(&step, "60 rad/s step"), figure(&slow, "0.25 Hz"), figure(&fast, "1 Hz")]
            .into_iter()
            .flatten()
            .collect(),
    }
}
