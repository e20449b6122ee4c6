//! What passes from one controller to the next, and what one leaves when its work ends, or its servo's does.

use kort_proto::faults::Fault;
use kort_proto::messages::Command;

use super::Tick;

impl Tick {
    /// With the faults that a predecessor had latched.
    pub fn with_latched(self, latched: u64) -> Self {
        Self { latched, ..self }
    }

    /// What stands latched when another servo, with a shared memory of its own, takes the place of the one that is heard: that
    /// one knows nothing of the faults of this, nor that it drove.
    pub fn leaves_behind(&self) -> u64 {
        let lost = self.armed || self.servo_faults != 0;
        self.latched | if lost { Fault::ServoLost.bit() } else { 0 }
    }

    /// The last command before the process ends.
    pub fn last_command(&self, command: Command) -> Command {
        let stop = if self.latched == 0 { Command::ENDS } else { Command::STOPS };
        Command { drive: 0.0, stop, ..command }
    }
}
