//! Metrics for Prometheus: base units, label `thruster`.

mod families;

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::{PATHS, RESIDUALS};
use kort_proto::signals::Kind as SignalKind;
use kort_proto::transport::Restarts;
use prometheus::{TEXT_FORMAT, TextEncoder};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::durations::BOUNDS_S;
use crate::problem::{Kind, Problem};
use crate::process::Usage;
use crate::tally::Tally;
use crate::thruster::Thruster;
use families::Families;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(metrics))
}

/// Metrics in Prometheus' text format. Fast signals are the mean of the last second; beside each stand NAME_min and NAME_max.
#[utoipa::path(get, path = "/metrics", tag = "health",
    responses(
        (status = 200, description = "Prometheus text format 0.0.4", body = String, content_type = "text/plain"),
        (status = 500, description = "`internal`", body = Problem, content_type = "application/problem+json")))]
async fn metrics(State(app): State<Arc<App>>) -> Result<impl IntoResponse, Problem> {
    let families = gather(&app).into_families();
    let text = TextEncoder::new()
        .encode_to_string(&families)
        .map_err(|e| Problem::new(Kind::Internal, e.to_string()))?;
    Ok(([(header::CONTENT_TYPE, TEXT_FORMAT)], text))
}

fn gather(app: &App) -> Families {
    let mut families = Families::default();
    families.gauge(
        "build_info",
        "Always 1; the label says which kort runs.",
        &[("version", env!("CARGO_PKG_VERSION"))],
        1.0,
    );
    for (thruster, tally) in app.thrusters().iter().zip(app.tallies()) {
        signals(&mut families, thruster, tally);
        energy(&mut families, thruster, tally);
        state(&mut families, thruster, tally);
        loops(&mut families, thruster, tally);
        trial(&mut families, thruster);
        recordings(&mut families, &thruster.id, app);
    }
    service(&mut families, app);
    for (class, count) in app.answers() {
        families.counter(
            "http_responses_total",
            "Answers by class of status code.",
            &[("class", class)],
            count as f64,
        );
    }
    families
}

fn recordings(families: &mut Families, id: &str, app: &App) {
    let (totals, label) = (app.recorder().totals(id), [("thruster", id)]);
    families.gauge(
        "recording_active",
        "Recordings of this thruster that run.",
        &label,
        totals.running as f64,
    );
    let counters = [
        ("recording_rows_total", "Rows recorded since the gateway started.", totals.rows),
        ("recording_lost_samples_total", "Samples recordings missed since the gateway started.", totals.lost),
        ("recordings_failed_total", "Recordings that the disk ended.", totals.failed),
    ];
    for (name, help, value) in counters {
        families.counter(name, help, &label, value as f64);
    }
}

/// What concerns the service as a whole.
fn service(families: &mut Families, app: &App) {
    let mut processes = app.watched().restarts;
    if processes.is_empty() {
        // No supervisor: of the others nothing is known but what shared memory says.
        let process = "gateway".to_owned();
        processes.push(Restarts { process, thruster: None, count: 0, pid: Some(std::process::id()) });
    }
    for Restarts { process, thruster, count, pid } in &processes {
        let labels = [("thruster", thruster.as_deref().unwrap_or("")), ("process", process)];
        families.counter(
            "process_restarts_total",
            "Times the supervisor started this process anew since it started itself.",
            &labels,
            *count as f64,
        );
        let Some(usage) = pid.and_then(Usage::of) else { continue };
        families.counter("process_cpu_seconds_total", "Processor time of the process.", &labels, usage.cpu_s);
        families.gauge("process_resident_bytes", "Memory of the process.", &labels, usage.resident_bytes);
    }
    families.gauge("streams_open", "WebSocket streams that are open.", &[], app.streams().count() as f64);
    let (open, refused, evicted) = app.connections().counts();
    families.gauge("connections_open", "Connections that are open.", &[], open as f64);
    families.counter("connections_refused_total", "Connections there was no room for.", &[], refused as f64);
    families.counter(
        "connections_evicted_total",
        "Idle connections that were ended to make room for others.",
        &[],
        evicted as f64,
    );
    let unwritten = app.events().unwritten() as f64;
    families.gauge(
        "events_unwritten",
        "Events that the event log on disk has not taken yet.",
        &[],
        unwritten,
    );
    if let Some(certificate) = app.certificate() {
        families.gauge(
            "tls_certificate_expiry_seconds",
            "When the TLS certificate ends, Unix time.",
            &[],
            certificate.ends_s() as f64,
        );
    }
    for (what, free, size) in app.disks() {
        families.gauge("disk_free_bytes", "Space left where this is written.", &[("disk", what)], free);
        families.gauge("disk_size_bytes", "Size of the disk where this is written.", &[("disk", what)], size);
    }
    for (route, counts) in app.durations().counts() {
        families.histogram(
            "http_request_duration_seconds",
            "Time from a request's head to the start of its answer.",
            &[("route", &route)],
            BOUNDS_S.into_iter().zip(counts.buckets),
            counts.buckets.iter().sum(),
            counts.sum_s,
        );
    }
}

/// One row of `proto/src/signals.rs` is one metric here; a process that is away has no values.
fn signals(families: &mut Families, thruster: &Thruster, tally: &Tally) {
    let (servo, controller) = thruster.heard().alive(Instant::now());
    for (kind, metric, meaning, window) in tally.counts().windows() {
        let alive = if kind == SignalKind::Estimated { controller } else { servo };
        let Some(window) = window.filter(|_| alive) else { continue };
        let label = [("thruster", thruster.id.as_str())];
        families.gauge(metric, &format!("{meaning} Mean of the last second."), &label, window.mean);
        for (stat, value) in [("min", window.min), ("max", window.max)] {
            let words = format!("{meaning} Its {stat} in the last second.");
            families.gauge(&format!("{metric}_{stat}"), &words, &label, value);
        }
    }
}

/// Power and energy of the motor, where current or shaft torque are measured.
fn energy(families: &mut Families, thruster: &Thruster, tally: &Tally) {
    let (label, energy) = ([("thruster", thruster.id.as_str())], tally.counts().energy);
    let (servo, _) = thruster.heard().alive(Instant::now());
    let Some(power) = energy.power_w() else { return };
    if servo {
        let words = "Power into the motor, winding's loss included where the rig states its resistance; negative when it gives power back.";
        families.gauge("motor_power_watts", &format!("{words} Mean of the last second."), &label, power.mean);
        for (stat, value) in [("min", power.min), ("max", power.max)] {
            let words = format!("{words} Its {stat} in the last second.");
            families.gauge(&format!("motor_power_watts_{stat}"), &words, &label, value);
        }
    }
    for (direction, energy_j) in [("taken", energy.taken_j), ("returned", energy.returned_j)] {
        families.counter(
            "motor_energy_joules_total",
            "Energy into the motor, and back from it, since the gateway started.",
            &[("thruster", thruster.id.as_str()), ("direction", direction)],
            energy_j,
        );
    }
}

fn state(families: &mut Families, thruster: &Thruster, tally: &Tally) {
    let now = Instant::now();
    let (id, heard, counts) = (thruster.id.as_str(), thruster.heard(), tally.counts());
    let label = [("thruster", id)];
    let (servo, controller) = heard.alive(now);
    for (process, alive) in [("servo", servo), ("controller", controller)] {
        families.gauge(
            "process_up",
            "Is this process heard?",
            &[("thruster", id), ("process", process)],
            f64::from(alive),
        );
    }
    families.gauge("armed", "Is the drive armed?", &label, f64::from(heard.shown_armed(now)));

    let latched = heard.shown_faults(now);
    for (fault, raised) in Fault::ALL.iter().zip(&counts.faults_raised) {
        let labels = [("thruster", id), ("fault", fault.name())];
        families.gauge(
            "fault_latched",
            "Is this fault latched?",
            &labels,
            f64::from(latched & fault.bit() != 0),
        );
        families.counter("faults_total", "Times this fault was raised.", &labels, *raised as f64);
    }
    let limits = heard.limits(now);
    for limit in Limit::all() {
        let active = f64::from(limits & limit.bit() != 0);
        families.gauge(
            "limit_active",
            "Does this limit hold the thruster back?",
            &[("thruster", id), ("limit", limit.name())],
            active,
        );
    }

    let desk = thruster.desk();
    let left_s = desk.lease.current(now).map(|lease| lease.expires_in_ms(now) as f64 * 1e-3);
    families.gauge("lease_held", "Has somebody the lease?", &label, f64::from(left_s.is_some()));
    families.gauge("lease_remaining_seconds", "Life left of the lease.", &label, left_s.unwrap_or(0.0));
    let (granted, expired) = desk.lease.counts();
    families.counter("leases_granted_total", "Leases granted.", &label, granted as f64);
    families.counter("leases_expired_total", "Leases that ran out.", &label, expired as f64);
    if let Some(given) = desk.given() {
        let age_s = now.saturating_duration_since(given).as_secs_f64();
        families.gauge("setpoint_age_seconds", "Time since the last accepted setpoint.", &label, age_s);
    }
    families.counter("setpoints_accepted_total", "Setpoints accepted.", &label, desk.accepted() as f64);
    drop(desk);

    families.counter(
        "telemetry_samples_total",
        "Samples read from the servo.",
        &label,
        counts.telemetry.0 as f64,
    );
    families.counter(
        "telemetry_lost_samples_total",
        "Samples the gateway came too late for.",
        &label,
        counts.telemetry.1 as f64,
    );
    if let Some((_, telemetry)) = &heard.servo {
        for (reason, count) in [("invalid", telemetry.commands_invalid), ("stale", telemetry.commands_stale)]
        {
            families.counter(
                "commands_refused_total",
                "Commands the servo refused.",
                &[("thruster", id), ("reason", reason)],
                count as f64,
            );
        }
    }
    if let Some(telemetry) = heard.telemetry(now) {
        families.gauge(
            "thermal_load_ratio",
            "Share of the I2t budget in use.",
            &label,
            telemetry.thermal_load,
        );
    }
    if let Some((_, state)) = &heard.controller {
        families.counter(
            "setpoints_refused_total",
            "Setpoints the controller refused.",
            &label,
            state.setpoints_invalid as f64,
        );
    }
    if let Some(state) = heard.controller(now) {
        families.gauge(
            "controller_info",
            "Always 1; the label says which law runs.",
            &[("thruster", id), ("controller", state.law.as_str())],
            1.0,
        );
        families.gauge(
            "estimator_frozen",
            "Is the estimator frozen for want of excitation?",
            &label,
            f64::from(state.estimator_frozen != 0),
        );
        for ((k, path), level) in PATHS.iter().enumerate().zip(state.mismatch_level) {
            let labels = [("thruster", id), ("path", *path)];
            let alarm = f64::from(u8::from(state.mismatch_path as usize == k + 1));
            families.gauge(
                "mismatch_alarm",
                "Has this path changed since it was learnt what is usual?",
                &labels,
                alarm,
            );
            if level.is_finite() {
                let words = "How near a path is to an alarm of mismatch: 1 is one.";
                families.gauge("mismatch_level_ratio", words, &labels, level);
            }
        }
        for (residual, share) in RESIDUALS.iter().zip(state.mismatch_lately).filter(|(_, x)| x.is_finite()) {
            let words =
                "Measured less expected in the last minute of driving, of what the rig as stated expects.";
            let labels = [("thruster", id), ("residual", *residual)];
            families.gauge("mismatch_residual_ratio", words, &labels, share);
        }
        for parameter in state.parameters.iter().take(state.parameter_count as usize) {
            let labels =
                [("thruster", id), ("parameter", parameter.name.as_str()), ("unit", parameter.unit.as_str())];
            families.gauge(
                "estimated_parameter",
                "Estimate, in the unit the label names.",
                &labels,
                parameter.value,
            );
            families.gauge(
                "estimated_parameter_error",
                "Standard error of the estimate, in the unit the label names.",
                &labels,
                parameter.std_error,
            );
        }
    }
}

/// How the thrust fares since another revision of the rig came into force.
fn trial(families: &mut Families, thruster: &Thruster) {
    let Some(trial) = thruster.trial().view() else { return };
    let label = [("thruster", thruster.id.as_str())];
    families.gauge(
        "rig_revision_worse",
        "Is the thrust error larger under the rig's revision in force than under the one before? Absent while that is not judged.",
        &label,
        trial.larger.map_or(f64::NAN, f64::from),
    );
    let errors = [("before", trial.before_rms_n), ("since", trial.since_rms_n)];
    for (when, rms_n) in errors {
        families.gauge(
            "rig_revision_thrust_error_newtons",
            "Root mean square of the thrust error before the rig's revision in force and since, under like commands.",
            &[("thruster", thruster.id.as_str()), ("when", when)],
            rms_n.unwrap_or(f64::NAN),
        );
    }
}

fn loops(families: &mut Families, thruster: &Thruster, tally: &Tally) {
    let heard = thruster.heard();
    let loops = [
        ("servo", heard.servo.map(|(_, t)| t.timing)),
        ("controller", heard.controller.map(|(_, c)| c.timing)),
        ("gateway", Some(tally.counts().gateway)),
    ];
    for (process, timing) in loops {
        let Some(timing) = timing else { continue };
        let labels = [("thruster", thruster.id.as_str()), ("process", process)];
        families.gauge("loop_period_seconds", "Period of the loop.", &labels, timing.period_ns as f64 * 1e-9);
        families.gauge("loop_busy_seconds", "Work of the last tick.", &labels, timing.busy_ns as f64 * 1e-9);
        families.counter(
            "loop_overruns_total",
            "Ticks skipped because the loop came too late.",
            &labels,
            timing.overruns as f64,
        );
        families.lateness("loop_lateness_seconds", "How late the loop woke up.", &labels, &timing);
    }
}
