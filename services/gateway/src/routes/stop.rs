//! Stopping everything.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::{Extension, State};
use kort_proto::events::EventKind;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::problem::{Kind, Problem};
use crate::token::Identity;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(stop))
}

/// Every thruster was stopped.
#[derive(Serialize, ToSchema)]
struct Stopped {
    /// Thrusters whose servo confirmed that it is at zero torque, disarmed.
    #[schema(example = json!(["t1"]))]
    stopped: Vec<String>,
}

/// Brings every thruster to zero torque and disarms it, whoever holds a lease. The answer is the servos' own word.
#[utoipa::path(post, path = "/v1/stop", tag = "command",
    responses(
        (status = 200, description = "Every servo confirmed", body = Stopped),
        (status = 503, description = "`not-ready`: a servo did not confirm; it names which", body = Problem, content_type = "application/problem+json")))]
async fn stop(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
) -> Result<axum::Json<Stopped>, Problem> {
    stop_all(&app, &who.name).await.map(|stopped| axum::Json(Stopped { stopped }))
}

/// Disarms all at once; the names of those that confirmed, or who did not. It goes on, and is told, though nobody waits for
/// the answer any more.
pub async fn stop_all(app: &Arc<App>, who: &str) -> Result<Vec<String>, Problem> {
    let stopping = tokio::spawn(stop_and_tell(Arc::clone(app), who.to_owned()));
    stopping.await.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?
}

async fn stop_and_tell(app: Arc<App>, who: String) -> Result<Vec<String>, Problem> {
    let why = format!("{who} stopped every thruster");
    let now = Instant::now();
    let armed = app.thrusters().iter().filter(|thruster| thruster.heard().armed(now));
    let armed: Vec<&str> = armed.map(|thruster| thruster.id.as_str()).collect();
    let asked: Vec<_> = app
        .thrusters()
        .iter()
        .map(|thruster| {
            let (thruster, why) = (Arc::clone(thruster), why.clone());
            (thruster.id.clone(), tokio::spawn(async move { thruster.stop(&why).await }))
        })
        .collect();
    let (mut stopped, mut silent) = (Vec::new(), Vec::new());
    for (id, asked) in asked {
        match asked.await {
            Ok(Ok(())) => stopped.push(id),
            _ => silent.push(id),
        }
    }
    let named = |words: &str, ids: &[&str]| match ids {
        [] => String::new(),
        ids => format!("; {words}: {}", ids.join(", ")),
    };
    let confirmed = named("confirmed", &stopped.iter().map(String::as_str).collect::<Vec<_>>());
    // One that had something to stop is another event than those around it that had not.
    let confirmed = confirmed + &named("was armed", &armed);
    if silent.is_empty() {
        app.events().tell(EventKind::Stopped, None, &who, why + &confirmed);
        return Ok(stopped);
    }
    let words = format!("no servo confirmed the stop of {}{confirmed}", silent.join(", "));
    app.events().tell(EventKind::Stopped, None, &who, format!("{who} asked every thruster to stop; {words}"));
    Err(Problem::new(Kind::NotReady, words)
        .hint("its command time-out stops the drive; cut the supply if the shaft still turns"))
}
