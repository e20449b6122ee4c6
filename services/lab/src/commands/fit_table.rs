//! `kort fit-table`: a rig description from a table of settled bollard points.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use kort_recording::{ColumnMap, Recording};
use serde::Serialize;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::files;
use crate::outputs::Named;

mod branch;

use branch::{Branch, Geometry};

const EXAMPLE: &str = "\
Example: kort fit-table t200_static.csv --columns t200-static:16 --name t200 \\
             --radius-m 0.038 --duct-length-m 0.04 --pitch-rad 0.39 --inertia-kg-m2 1e-4 -o t200.toml

The table holds settled points: duty_cmd, shaft_speed_rad_s, thrust_n, supply_current_a, supply_v.";

/// Make a rig description from a table of settled points, and say what it cannot fix
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Args {
    /// Table of settled points
    table: PathBuf,
    /// Column map; `NAME:RUN` takes one supply voltage of several
    #[arg(long, value_name = "MAP")]
    columns: Option<String>,
    /// Name of the thruster
    #[arg(long, default_value = "thruster")]
    name: String,
    /// Radius of the duct, m
    #[arg(long)]
    radius_m: f64,
    /// Length of the duct, m; no static table fixes it
    #[arg(long)]
    duct_length_m: f64,
    /// Pitch of the blade at 0.7 radius, rad; no static table fixes it
    #[arg(long)]
    pitch_rad: f64,
    /// Inertia of everything that turns, kg m^2; no static table fixes it
    #[arg(long)]
    inertia_kg_m2: f64,
    /// Density of the water, kg/m^3
    #[arg(long, default_value_t = 998.0)]
    density_kg_m3: f64,
    /// Where to write the rig description
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print one JSON document (kort.fit-table/1)
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let named = Named::default().reads("table", &self.table).reads_map(self.columns.as_deref());
        named.writes_toml("-o", self.output.as_deref())
    }
}

/// One run of the table: a supply voltage.
#[derive(Serialize)]
struct Run {
    run: String,
    supply_v: f64,
    ahead: Branch,
    astern: Branch,
    /// Largest thrust ahead over astern.
    asymmetry: f64,
    /// Commands between which the shaft stands still.
    dead_band: Option<(f64, f64)>,
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    table: String,
    chosen: &'a Run,
    lift_max: f64,
    drag_max: f64,
    other_runs: &'a [Run],
    thrust_over_supply_exponent: Option<f64>,
    not_identifiable: Vec<(&'static str, &'static str)>,
}

/// Parameters that settled bollard points leave open, and why.
const OPEN: [(&str, &str); 6] = [
    ("inertia_kg_m2", "nothing accelerates; given by the user"),
    ("added_mass_coefficient", "nothing accelerates; 1, the bare water in the duct"),
    ("duct_length_m", "only in the added mass; given by the user"),
    ("flux_coefficient", "the flow is not measured; 2, theory"),
    ("pitch_rad", "one angle of attack only: lift_max and drag_max belong to the given pitch"),
    ("time_constant_s", "nothing changes; 0.02 s, usual for such a drive"),
];

/// Does it.
///
/// # Errors
/// The table cannot be read, lacks a column, or its points give no physical blade at that pitch.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    for (flag, value) in [
        ("--radius-m", args.radius_m),
        ("--duct-length-m", args.duct_length_m),
        ("--pitch-rad", args.pitch_rad),
        ("--inertia-kg-m2", args.inertia_kg_m2),
        ("--density-kg-m3", args.density_kg_m3),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Failure::input(format!(
                "{flag} = {value} must be above zero\nhint: SI units, 0.038 for 76 mm across"
            )));
        }
    }
    let map = files::read_columns(args.columns.as_deref())?;
    let chosen = read(&args.table, map.as_ref())?;
    let others = other_runs(&args.table, map.as_ref(), &chosen)?;
    let geometry = Geometry {
        radius_m: args.radius_m,
        pitch_rad: args.pitch_rad,
        density_kg_m3: args.density_kg_m3,
        flux_coefficient: 2.0,
    };
    let (lift, drag) = geometry.blade(&chosen.ahead);
    if !(lift > 0.0 && drag > 0.0) {
        return Err(Failure::in_file(
            &args.table,
            format!(
                "at --pitch-rad {} the points ask for lift_max = {lift:.3}, drag_max = {drag:.3}; both must be above zero\n\
                 hint: the steady inflow angle is {:.3} rad; give a pitch above it",
                args.pitch_rad,
                geometry.inflow_rad(&chosen.ahead)
            ),
        ));
    }
    let description = toml(args, &chosen, &others, lift, drag);
    // What is written must be readable; what no rig may be was asked for.
    kort_thruster::rig::Rig::from_toml(&description).map_err(|wrong| {
        let options = [
            ("`propeller.radius_m`", "--radius-m"),
            ("`propeller.duct_length_m`", "--duct-length-m"),
            ("`propeller.pitch_rad`", "--pitch-rad"),
            ("`motor.inertia_kg_m2`", "--inertia-kg-m2"),
            ("`flow.density_kg_m3`", "--density-kg-m3"),
        ];
        let words = wrong.to_string();
        match options.iter().find(|(key, _)| words.contains(key)) {
            Some((key, option)) => Failure::input(words.replace(key, option)),
            None => Failure::in_file(&args.table, words),
        }
    })?;
    // The result is printed whatever becomes of its file.
    let written = args.output.as_ref().map_or(Ok(()), |path| {
        write_text(path, &description).inspect(|()| eprintln!("rig: {}", path.display()))
    });
    if args.json {
        print_json(&Document {
            schema: "kort.fit-table/1",
            table: args.table.display().to_string(),
            chosen: &chosen,
            lift_max: lift,
            drag_max: drag,
            thrust_over_supply_exponent: exponent(&chosen, &others),
            other_runs: &others,
            not_identifiable: OPEN.to_vec(),
        })?;
    } else if args.output.is_some() {
        print(&findings(&chosen, &others, "").replace("\n# ", "\n"))?;
    } else {
        print(&description)?;
    }
    written.map(|()| Outcome::Done)
}

fn read(path: &Path, map: Option<&ColumnMap>) -> Result<Run, Failure> {
    let recording = files::read_recording(path, map)?;
    let need = |name: &str| column(&recording, name).map_err(|e| Failure::in_file(path, e));
    let (duty, speed, thrust) = (need("duty_cmd")?, need("shaft_speed_rad_s")?, need("thrust_n")?);
    let (current, supply) = (need("supply_current_a")?, need("supply_v")?);
    let supply_v = supply.iter().copied().find(|v| v.is_finite()).unwrap_or(f64::NAN);
    let side = |sign: f64| {
        let rows: Vec<usize> =
            (0..duty.len()).filter(|i| sign * duty[*i] > 0.0 && speed[*i] != 0.0).collect();
        let of = |x: &[f64]| rows.iter().map(|i| x[*i].abs()).collect::<Vec<_>>();
        Branch::fit(&of(duty), &of(speed), &of(thrust), &of(current), supply_v)
            .ok_or_else(|| Failure::in_file(path, "too few moving points in one direction: four are needed"))
    };
    let (ahead, astern) = (side(1.0)?, side(-1.0)?);
    let still = || (0..duty.len()).filter(|i| speed[*i] == 0.0).map(|i| duty[i]);
    let dead_band = still()
        .next()
        .map(|_| (still().fold(f64::INFINITY, f64::min), still().fold(f64::NEG_INFINITY, f64::max)));
    let run = map.and_then(|m| m.select.as_ref()).map_or_else(String::new, |s| s.value.clone());
    Ok(Run {
        run,
        supply_v,
        asymmetry: ahead.largest_thrust_n / astern.largest_thrust_n,
        ahead,
        astern,
        dead_band,
    })
}

fn column<'a>(recording: &'a Recording, name: &str) -> Result<&'a [f64], String> {
    recording.column(name).ok_or_else(|| {
        format!("there is no column `{name}`\nhint: give a column map with --columns that makes it; see config/columns")
    })
}

/// The file's other runs, where the map tells several apart.
fn other_runs(path: &Path, map: Option<&ColumnMap>, chosen: &Run) -> Result<Vec<Run>, Failure> {
    let Some((map, select)) = map.and_then(|m| m.select.as_ref().map(|s| (m, s))) else { return Ok(vec![]) };
    let text = crate::failure::read_text(path)?;
    let mut lines = text.lines();
    let place = lines.next().and_then(|head| head.split(',').position(|name| name.trim() == select.source));
    let Some(place) = place else { return Ok(vec![]) };
    let values: BTreeSet<&str> = lines.filter_map(|l| l.split(',').nth(place)).map(str::trim).collect();
    values
        .into_iter()
        .filter(|v| *v != chosen.run)
        .map(|value| {
            let mut map = map.clone();
            map.select =
                Some(kort_recording::map::Select { source: select.source.clone(), value: value.into() });
            read(path, Some(&map))
        })
        .collect()
}

/// Exponent of largest thrust ahead over supply voltage, between lowest and highest supply.
fn exponent(chosen: &Run, others: &[Run]) -> Option<f64> {
    let by = |a: &&Run, b: &&Run| a.supply_v.total_cmp(&b.supply_v);
    let runs = || others.iter().chain([chosen]);
    let (low, high) = (runs().min_by(by)?, runs().max_by(by)?);
    (high.supply_v > low.supply_v).then(|| {
        (high.ahead.largest_thrust_n / low.ahead.largest_thrust_n).ln() / (high.supply_v / low.supply_v).ln()
    })
}

/// What the table says and what it leaves open, each line behind `prefix`.
fn findings(chosen: &Run, others: &[Run], prefix: &str) -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        let _ = writeln!(out, "{prefix}{text}");
    };
    line("In the table:".into());
    let mut runs: Vec<&Run> = others.iter().chain([chosen]).collect();
    runs.sort_by(|a, b| a.supply_v.total_cmp(&b.supply_v));
    for run in runs {
        let dead = run.dead_band.map_or("none".into(), |(a, b)| format!("{a:+.3} to {b:+.3}"));
        line(format!(
            "  {:>4} V: thrust {:+.1} / -{:.1} N (ahead/astern {:.2}); T/Om^2 {:.3e} / {:.3e} N s^2; Q/Om^2 {:.2e} / {:.2e} N m s^2; \
             kt {:.4} N m/A, R {:.3} ohm; dead band of the duty {dead}",
            run.supply_v,
            run.ahead.largest_thrust_n,
            run.astern.largest_thrust_n,
            run.asymmetry,
            run.ahead.thrust_n_s2,
            run.astern.thrust_n_s2,
            run.ahead.torque_nm_s2,
            run.astern.torque_nm_s2,
            run.ahead.torque_constant_nm_a,
            run.ahead.resistance_ohm,
        ));
    }
    if let Some(power) = exponent(chosen, others) {
        line(format!(
            "  Largest thrust follows the supply to the power {power:.2}; the voltage column is nominal, so sag is not seen."
        ));
    }
    line("The table cannot fix:".into());
    for (name, why) in OPEN {
        line(format!("  {name}: {why}"));
    }
    line(
        "A rig description has one blade for both directions: it is fitted ahead, and `tol` of lift_max and"
            .into(),
    );
    line("drag_max spans what astern differs. The dead band is no key of it; effects forward_reverse_asymmetry and".into());
    line("command_dead_band carry both. Torque was not measured: it is kt times the motor current that the electrical".into());
    line("power implies with a lossless drive, so kt, R and drag_max hold the drive's losses.".into());
    out
}

fn toml(args: &Args, run: &Run, others: &[Run], lift: f64, drag: f64) -> String {
    let spread = |a: f64, b: f64| ((a - b).abs() / a.max(b)).clamp(0.02, 1.0);
    let tol = spread(run.ahead.thrust_n_s2, run.astern.thrust_n_s2)
        .max(spread(run.ahead.torque_nm_s2, run.astern.torque_nm_s2));
    let map = args.columns.as_deref().map_or(String::new(), |c| format!(" --columns {c}"));
    let b = &run.ahead;
    format!(
        "# Made by: kort fit-table {table}{map} --name {name} --radius-m {radius} --duct-length-m {length} \\\n\
         #   --pitch-rad {pitch} --inertia-kg-m2 {inertia}\n\
         # Fit ahead over {points} points: thrust to {thrust_error:.1} % of the largest (r.m.s.), motor voltage to {voltage_error:.1} %.\n\
         {findings}\
         [rig]\n\
         name = \"{name}\"\n\
         class = \"small vehicle thruster, fitted to a static table\"\n\n\
         [propeller]\n\
         radius_m = {radius}        # m, given\n\
         duct_length_m = {{ value = {length}, tol = 0.5 }}   # m, given\n\
         pitch_rad = {{ value = {pitch}, tol = 0.3 }}       # rad, given\n\
         lift_max = {{ value = {lift:.4}, tol = {tol:.2} }}    # 1, from T/Om^2 and Q/Om^2 ahead, at this pitch\n\
         drag_max = {{ value = {drag:.4}, tol = {tol:.2} }}    # 1, likewise\n\n\
         [flow]\n\
         density_kg_m3 = {density}\n\
         flux_coefficient = {{ value = 2.0, tol = 0.2 }}       # 1, theory\n\
         added_mass_coefficient = {{ value = 1.0, tol = 1.0 }} # 1, the bare water in the duct\n\n\
         [motor]\n\
         inertia_kg_m2 = {{ value = {inertia}, tol = 1.0 }}      # kg m^2, given\n\
         torque_constant_nm_a = {{ value = {kt:.5}, tol = 0.2 }} # N m/A, from voltage and current over speed\n\
         winding_resistance_ohm = {{ value = {r:.4}, tol = 0.3 }} # ohm, likewise\n\n\
         [amplifier]\n\
         kind = \"voltage\"             # command in volts: duty times supply\n\
         time_constant_s = {{ value = 0.02, tol = 1.0 }}\n\
         current_limit_a = {limit:.1}      # A, the largest motor current in the table\n\
         supply_v = {supply}\n\n\
         [run]\n\
         water = \"tank\"\n",
        table = args.table.display(),
        name = args.name,
        radius = args.radius_m,
        length = args.duct_length_m,
        pitch = args.pitch_rad,
        inertia = args.inertia_kg_m2,
        density = args.density_kg_m3,
        points = b.points,
        thrust_error = b.thrust_error_pct,
        voltage_error = b.voltage_error_pct,
        findings = findings(run, others, "# "),
        kt = b.torque_constant_nm_a,
        r = b.resistance_ohm,
        limit = b.largest_current_a.max(run.astern.largest_current_a),
        supply = run.supply_v,
    )
}
