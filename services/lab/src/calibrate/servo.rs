//! The servo's process of a session.

use std::path::PathBuf;
use std::process::{Child, Command as Program};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use super::live::Bench;
use crate::failure::Failure;

/// A servo that was told to end is killed after this.
const ENDS_WITHIN: Duration = Duration::from_secs(2);

/// The servo's process; it ends with this one. None: it is the service's.
pub struct Servo(Option<Child>);

impl Servo {
    /// That of the service which runs on the bench.
    pub fn of_service() -> Self {
        Self(None)
    }

    /// Starts it for this bench.
    ///
    /// # Errors
    /// There is no process to be had.
    pub fn start(bench: &Bench) -> Result<Self, Failure> {
        let program: PathBuf = std::env::current_exe().map_err(Failure::failed)?;
        let mut command = Program::new(program);
        command.arg("servo").arg("--root").arg(bench.deployment.root());
        command.arg("--parent").arg(std::process::id().to_string());
        if let Some(file) = bench.file.or(bench.config.file.as_deref()) {
            command.arg("--config").arg(file);
        }
        command.arg("--thruster").arg(bench.thruster);
        command.spawn().map(|child| Self(Some(child))).map_err(Failure::failed)
    }

    /// Has it ended?
    pub fn ended(&mut self) -> Option<Failure> {
        let status = self.0.as_mut()?.try_wait().ok().flatten()?;
        let words = format!("the servo ended ({status}); its reason stands above");
        Some(match status.code() {
            Some(2) => Failure::Input(words),
            _ => {
                Failure::Failed(format!("{words}\nhint: if a service runs on this deployment, stop it first"))
            }
        })
    }
}

impl Drop for Servo {
    fn drop(&mut self) {
        let Some(child) = &mut self.0 else { return };
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        let end = Instant::now() + ENDS_WITHIN;
        while Instant::now() < end && matches!(child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = child.kill();
        let _ = child.wait();
    }
}
