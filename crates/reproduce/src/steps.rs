//! Torque steps: Figure 4 (9.2 N m), Figures 5 and 6 (18 levels), and what overshoot takes.

use kort_thruster::blade::BladeLoad;
use kort_thruster::effects;
use kort_thruster::models::{DriveInput, Model, Model1, Model2, ModelName, RotationalFlow};
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{Quantity, Sensors};

use crate::figure::{Figure, Mark, Series};
use crate::steady::{EQ18, EQ19, EQ20, LARGEST_TORQUE_N_M, efficiency_from_thrust};
use crate::{Paper, Part, Row, overshoot_pct, rise_s, settled};

/// Figure 4's step, N m.
const STEP_N_M: f64 = 9.2;
const DT_S: f64 = 1e-3;

/// A response from rest.
struct Response {
    time_s: Vec<f64>,
    speed_rad_s: Vec<f64>,
    thrust_n: Vec<f64>,
}

impl Response {
    /// The model under a torque, N m, from rest.
    fn of<const N: usize, M: Model<N, Input = DriveInput>>(
        model: &M,
        torque_n_m: f64,
        duration_s: f64,
    ) -> Self {
        let input = DriveInput::torque(torque_n_m);
        let mut x = M::State::from([0.0; N]);
        let mut out = Self { time_s: vec![], speed_rad_s: vec![], thrust_n: vec![] };
        for k in 0..(duration_s / DT_S) as usize {
            let BladeLoad { thrust_n, .. } = model.load(x, &input);
            let states: [f64; N] = x.into();
            out.push(k as f64 * DT_S, states[0], thrust_n);
            x = model.step(x, &input, DT_S);
        }
        out
    }

    fn push(&mut self, time_s: f64, speed_rad_s: f64, thrust_n: f64) {
        self.time_s.push(time_s);
        self.speed_rad_s.push(speed_rad_s);
        self.thrust_n.push(thrust_n);
    }
}

/// Model 1 as the paper simulates it: the efficiency from (18) in map and motion.
fn model1(paper: &Paper) -> Model1 {
    let mut p = paper.parameters;
    p.set(P::Efficiency, efficiency_from_thrust(paper, EQ18));
    Model1::new(&p)
}

pub(crate) fn one_step(paper: &Paper) -> Part {
    let one = Response::of(&model1(paper), STEP_N_M, 4.0);
    let two = Response::of(&Model2::new(&paper.parameters), STEP_N_M, 4.0);
    let none = |x: f64| x < 0.1;
    let row = |id, what: &str, y: &[f64], note: &str| {
        let over = overshoot_pct(y);
        Row::words(
            id,
            what,
            "none in simulation, both in the recordings",
            format!("{over:.2} %"),
            none(over),
            note,
        )
    };
    let structural = "The simulation is reproduced; the recorded overshoot is what the model lacks.";
    let shown = |f: fn(&Response) -> &Vec<f64>, y: &str, caption: &str| {
        Figure::new(caption, "time after the step [s]", y)
            .with(Series::new("Model 1", Mark::Dashed, &one.time_s[..1500], &f(&one)[..1500]))
            .with(Series::new("Model 2", Mark::Line, &two.time_s[..1500], &f(&two)[..1500]))
    };
    let (t1, t2) = (settled(&one.thrust_n), settled(&two.thrust_n));
    Part {
        title: "Figure 4: the 9.2 N m step",
        text: "From rest, torque straight on the shaft; rise time to 90 % of the settled value.".into(),
        rows: vec![
            row("fig4_model1_thrust_overshoot", "Model 1: thrust overshoot", &one.thrust_n, structural),
            row("fig4_model1_speed_overshoot", "Model 1: speed overshoot", &one.speed_rad_s, structural),
            row("fig4_model2_thrust_overshoot", "Model 2: thrust overshoot", &two.thrust_n, structural),
            row("fig4_model2_speed_overshoot", "Model 2: speed overshoot", &two.speed_rad_s, structural),
            Row::number(
                "fig4_model2_thrust",
                "Model 2: settled thrust [N], against (20)",
                EQ20 * STEP_N_M,
                t2,
                5.0,
                "",
            ),
            Row::number(
                "fig4_model2_speed",
                "Model 2: settled speed [rad/s], against (19)",
                (STEP_N_M / EQ19).sqrt(),
                settled(&two.speed_rad_s),
                5.0,
                "",
            ),
            Row::number(
                "fig4_model1_thrust",
                "Model 1: settled thrust [N], against (20)",
                EQ20 * STEP_N_M,
                t1,
                5.0,
                "With the efficiency of (18) in both equations, as the paper has to do, Model 1's torque balance is off; \
                 the paper says as much (three efficiencies that differ).",
            ),
            Row::alone(
                "fig4_model1_rise",
                "Model 1: thrust rise time [s]",
                rise_s(&one.time_s, &one.thrust_n),
                "Printed as a curve only.",
            ),
            Row::alone(
                "fig4_model2_rise",
                "Model 2: thrust rise time [s]",
                rise_s(&two.time_s, &two.thrust_n),
                "Printed as a curve only.",
            ),
        ],
        figures: vec![
            shown(|r| &r.thrust_n, "thrust [N]", "Thrust after a 9.2 N m step"),
            shown(|r| &r.speed_rad_s, "shaft speed [rad/s]", "Shaft speed after a 9.2 N m step"),
        ],
    }
}

pub(crate) fn eighteen_steps(paper: &Paper) -> Part {
    let torques: Vec<f64> = (0..18).map(|i| LARGEST_TORQUE_N_M * (1.0 - 2.0 * f64::from(i) / 17.0)).collect();
    let two: Vec<Response> =
        torques.iter().map(|q| Response::of(&Model2::new(&paper.parameters), *q, 6.0)).collect();
    let one: Vec<Response> = torques.iter().map(|q| Response::of(&model1(paper), *q, 6.0)).collect();
    let swirl_model = RotationalFlow::new(&refitted(paper, true, 0.0));
    let swirl: Vec<Response> = torques.iter().map(|q| Response::of(&swirl_model, *q, 6.0)).collect();
    let worst = |f: fn(&Response) -> &Vec<f64>, runs: &[Response]| {
        runs.iter().map(|r| overshoot_pct(f(r))).fold(0.0, f64::max)
    };
    let rise: Vec<f64> = two.iter().map(|r| rise_s(&r.time_s, &r.thrust_n)).collect();
    let departure = torques
        .iter()
        .zip(&two)
        .map(|(q, r)| 100.0 * (settled(&r.thrust_n) / (EQ20 * q) - 1.0))
        .fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a });
    let fan = |runs: &[Response], f: fn(&Response) -> &Vec<f64>, caption: &str, y: &str| {
        runs.iter().fold(Figure::new(caption, "time after the step [s]", y), |figure, r| {
            figure.with(Series::new("", Mark::Line, &r.time_s[..3000], &f(r)[..3000]))
        })
    };
    let overshoot = |id, what: &str, over: f64| {
        Row::words(
            id,
            what,
            "none",
            format!("largest of 18: {over:.2} %"),
            over < 0.1,
            "The recordings show overshoot in thrust and speed at every level.",
        )
    };
    let swirl_rise = |k: usize| rise_s(&swirl[k].time_s, &swirl[k].thrust_n);
    let recorded = |id, what: &str, f: fn(&Response) -> &Vec<f64>, note: &str| {
        let (least, most) = swirl
            .iter()
            .map(|r| overshoot_pct(f(r)))
            .fold((f64::INFINITY, 0.0_f64), |(least, most), over| (least.min(over), most.max(over)));
        let printed = "in the recordings, at every level";
        Row::words(id, what, printed, format!("{least:.1} to {most:.1} % of 18"), least > 1.0, note)
    };
    Part {
        title: "Figures 5 and 6: 18 torque steps from +11 to -11 N m",
        text: "Evenly spaced, 1.294 N m apart, none at zero (nine a side at 1.222 N m would fit the text as well).".into(),
        rows: vec![
            overshoot("fig5_thrust_overshoot", "Model 1: thrust overshoot", worst(|r| &r.thrust_n, &one)),
            overshoot("fig5_speed_overshoot", "Model 1: speed overshoot", worst(|r| &r.speed_rad_s, &one)),
            overshoot("fig6_thrust_overshoot", "Model 2: thrust overshoot", worst(|r| &r.thrust_n, &two)),
            overshoot("fig6_speed_overshoot", "Model 2: speed overshoot", worst(|r| &r.speed_rad_s, &two)),
            Row::words(
                "fig6_steady_thrust",
                "Model 2: settled thrust at all levels, against (20)",
                "good agreement over the range",
                format!("largest departure {departure:+.1} %"),
                departure.abs() < 5.0,
                "Within 5 %.",
            ),
            Row::words(
                "fig6_variable_rise",
                "Model 2: rise time varies with level",
                "yes",
                format!("{:.3} s at 11 N m, {:.3} s at 0.65 N m", rise[0], rise[8]),
                rise[8] > 1.5 * rise[0],
                "In turns of the shaft it is the same at every level: all terms are quadratic.",
            ),
            recorded(
                "fig6_swirl_speed_overshoot",
                "rotational flow: speed overshoot",
                |r| &r.speed_rad_s,
                "Not simulated in the paper, which surmises it; coefficients of the study in section 3.3.3.",
            ),
            recorded(
                "fig6_swirl_thrust_overshoot",
                "rotational flow: thrust overshoot",
                |r| &r.thrust_n,
                "Swirl alone gives none; with profile drag both are there (section 3.3.3).",
            ),
            Row::words(
                "fig6_swirl_rise",
                "rotational flow: rise time varies with level",
                "yes",
                format!("{:.3} s at 11 N m, {:.3} s at 0.65 N m", swirl_rise(0), swirl_rise(8)),
                swirl_rise(8) > 1.5 * swirl_rise(0),
                "As in Model 2: the swirl's terms are quadratic too.",
            ),
        ],
        figures: vec![
            fan(&one, |r| &r.thrust_n, "Model 1, thrust, 18 steps (Figure 5, top right)", "thrust [N]"),
            fan(&one, |r| &r.speed_rad_s, "Model 1, shaft speed, 18 steps (Figure 5, bottom right)", "shaft speed [rad/s]"),
            fan(&two, |r| &r.thrust_n, "Model 2, thrust, 18 steps (Figure 6, top right)", "thrust [N]"),
            fan(&two, |r| &r.speed_rad_s, "Model 2, shaft speed, 18 steps (Figure 6, bottom right)", "shaft speed [rad/s]"),
            fan(&swirl, |r| &r.thrust_n, "Rotational flow, thrust, 18 steps", "thrust [N]"),
            fan(&swirl, |r| &r.speed_rad_s, "Rotational flow, shaft speed, 18 steps", "shaft speed [rad/s]"),
        ],
    }
}

/// Swirl coefficients of the study below: little wash-out, a light swirl.
const SWIRL: (f64, f64) = (1.0, 0.1);
const PROFILE_DRAG: f64 = 0.06;

/// `CLmax` and `CDmax` with which the steady state still gives (18) and (19) once swirl or a
/// profile drag is there: the flow follows from thrust, the swirl from torque, and at that inflow
/// both loads are linear in the two coefficients.
fn refitted(paper: &Paper, swirl: bool, profile_drag: f64) -> Parameters {
    let mut p = paper.parameters;
    let disc = p.get(P::DensityKgM3) * p.area_m2();
    let lever = p.blade().lever_m();
    let flow = (EQ18 / (p.get(P::FluxCoefficient) * disc)).sqrt();
    let us = if swirl { EQ19 / (SWIRL.0 * disc * flow * lever) } else { 0.0 };
    let load = |lift: f64, drag: f64| {
        let mut blade = p.blade();
        (blade.lift_max, blade.drag_max) = (lift, drag);
        let load = blade.load(blade.inflow(1.0, flow, us));
        (load.thrust_n, load.torque_n_m)
    };
    let (lift, drag) = (load(1.0, 0.0), load(0.0, 1.0));
    // Profile drag cd0 acts along the inflow: (rho a / 2) V cd0 (-vp, re ut).
    let ut = lever - us;
    let along = 0.5 * disc * ut.hypot(flow) * profile_drag;
    let (t, q) = (EQ18 + along * flow, EQ19 - along * lever * ut);
    let det = lift.0 * drag.1 - lift.1 * drag.0;
    p.set(P::LiftMax, (t * drag.1 - q * drag.0) / det);
    p.set(P::DragMax, (lift.0 * q - lift.1 * t) / det);
    p.set(P::SwirlFluxCoefficient, SWIRL.0);
    p.set(P::SwirlMassCoefficient, SWIRL.1);
    p
}

/// A torque step on the composed plant with ideal drive and sensors.
fn plant_step(
    paper: &Paper,
    name: ModelName,
    parameters: &Parameters,
    profile_drag: f64,
    torque: f64,
) -> Response {
    let mut rig = paper.rig.clone();
    rig.sensors = Sensors::IDEAL;
    rig.amplifier.time_constant_s = Quantity::exact(0.0);
    rig.amplifier.current_limit_a = f64::INFINITY;
    let mut parameters = *parameters;
    parameters.set(P::TimeConstantS, 0.0);
    let values = [profile_drag, 0.0, 0.0];
    let hidden: Vec<(&effects::Descriptor, &[f64])> = effects::find("nonsinusoidal_lift_drag")
        .filter(|_| profile_drag != 0.0)
        .map(|d| (d, values.as_slice()))
        .into_iter()
        .collect();
    let mut plant = Plant::new(name, &rig, &parameters, &hidden, DT_S);
    let current = torque / parameters.get(P::TorqueConstantNmA);
    let mut out = Response { time_s: vec![], speed_rad_s: vec![], thrust_n: vec![] };
    for k in 0..4000 {
        let truth = *plant.truth();
        out.push(k as f64 * DT_S, truth.shaft_speed_rad_s, truth.thrust_n);
        plant.step(&Tick { time_s: k as f64 * DT_S, command: current, ..Tick::default() });
    }
    out
}

pub(crate) fn overshoot(paper: &Paper) -> Part {
    let run = |name, swirl, profile_drag| {
        let p = refitted(paper, swirl, profile_drag);
        plant_step(paper, name, &p, profile_drag, STEP_N_M)
    };
    let plain = run(ModelName::Model2, false, 0.0);
    let drag = run(ModelName::Model2, false, PROFILE_DRAG);
    let swirl = run(ModelName::RotationalFlow, true, 0.0);
    let both = run(ModelName::RotationalFlow, true, PROFILE_DRAG);
    let pair = |r: &Response| (overshoot_pct(&r.thrust_n), overshoot_pct(&r.speed_rad_s));
    let row = |id, what: &str, r: &Response, printed: &str, same: fn(f64, f64) -> bool, note: &str| {
        let (thrust, speed) = pair(r);
        Row::words(
            id,
            what,
            printed,
            format!("thrust {thrust:.1} %, speed {speed:.1} %; rise {:.3} s", rise_s(&r.time_s, &r.thrust_n)),
            same(thrust, speed),
            note,
        )
    };
    let cases = [
        ("Model 2", &plain),
        ("Model 2 + profile drag", &drag),
        ("rotational flow", &swirl),
        ("rotational flow + profile drag", &both),
    ];
    let shown = |f: fn(&Response) -> &Vec<f64>, y: &str, caption: &str| {
        cases.iter().fold(Figure::new(caption, "time after the step [s]", y), |c, (name, r)| {
            c.with(Series::new(*name, Mark::Line, &r.time_s[..1200], &f(r)[..1200]))
        })
    };
    Part {
        title: "Section 3.3.3: what would overshoot",
        text: format!(
            "The 9.2 N m step with CLmax and CDmax solved anew in each case so that the steady state gives (18) and (19) \
             exactly. Profile drag cd0 = {PROFILE_DRAG}; swirl with dbr = {}, gr = {}: a study, not a fit, since the \
             recordings are printed as curves only.",
            SWIRL.0, SWIRL.1
        ),
        rows: vec![
            row(
                "overshoot_model2",
                "Model 2",
                &plain,
                "neither, with the fitted parameters",
                |t, s| t < 0.1 && s < 0.1,
                "",
            ),
            row(
                "overshoot_profile_drag",
                "Model 2 with another drag curve",
                &drag,
                "thrust only, with parameters tuned by hand; never speed",
                |t, s| t > 1.0 && s < 0.1,
                "Steady bollard data fix lift and drag at one angle only; another curve through that point overshoots in thrust.",
            ),
            row(
                "overshoot_swirl",
                "rotational flow",
                &swirl,
                "speed, surmised of a more detailed model",
                |_, s| s > 1.0,
                "Swirl is not washed out while the axial flow is small, so the blades are unloaded at first.",
            ),
            row(
                "overshoot_both",
                "rotational flow with profile drag",
                &both,
                "both, in the recordings",
                |t, s| t > 1.0 && s > 1.0,
                "Their sizes cannot be held against the recordings, which are not printed as numbers.",
            ),
        ],
        figures: vec![
            shown(|r| &r.thrust_n, "thrust [N]", "Thrust: what each omission does"),
            shown(|r| &r.speed_rad_s, "shaft speed [rad/s]", "Shaft speed: what each omission does"),
        ],
    }
}
