//! What is asked of the drive at the start, object by object, and what must come of it.

use kort_proto::messages::DriveKind;

use super::sdo::Job;
use super::{Cia402, state};

/// One object, and what is done with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its index.
    pub index: u16,
    /// Its sub-index.
    pub sub: u8,
    /// What is asked.
    pub job: Job,
    /// A drive that refuses it is not driven; else what depends on it is read back, or done without.
    pub needed: bool,
    /// What it is, in words.
    pub what: &'static str,
}

/// Time between two heartbeats of the drive, ms.
const HEARTBEAT_MS: u32 = 100;
/// A PDO that is switched off, and one that nobody may ask for by a remote frame.
const OFF: u32 = 1 << 31;
const NOT_ON_REQUEST: u32 = 1 << 30;

// Objects of PDOs, as a mapping names them: index, sub-index, bits.
const CONTROL: u32 = 0x6040_0010;
const STATUS: u32 = 0x6041_0010;
const MODE: u32 = 0x6061_0008;
const TARGET_TORQUE: u32 = 0x6071_0010;
const TORQUE: u32 = 0x6077_0010;
const TARGET_SPEED: u32 = 0x60ff_0020;
const POSITION: u32 = 0x6064_0020;
const SPEED: u32 = 0x606c_0020;

/// Everything, in its order: a drive at all, output off, who it is, mode, watchdog, PDOs, and its fault reset.
pub fn steps(drive: &Cia402) -> Vec<Step> {
    let mut steps = Vec::with_capacity(64);
    let mut step = |index, sub, job, needed, what| steps.push(Step { index, sub, job, needed, what });
    step(0x1000, 0, Job::Read(4), true, "device type");
    step(0x6040, 0, Job::Write(0, 2), true, "control word");
    step(0x1018, 1, Job::Read(4), true, "vendor");
    step(0x1018, 2, Job::Read(4), false, "product code");
    step(0x1018, 4, Job::Read(4), false, "serial number");
    step(0x6502, 0, Job::Read(4), false, "supported drive modes");
    step(0x6075, 0, Job::Read(4), true, "motor rated current");
    step(0x60a9, 0, Job::Read(4), false, "velocity unit");
    step(0x6060, 0, Job::Write(drive.mode().into(), 1), true, "mode of operation");
    step(0x6061, 0, Job::Read(1), true, "mode of operation display");
    step(
        0x1016,
        1,
        Job::Write(u32::from(drive.ours()) << 16 | drive.timeout_ms(), 4),
        false,
        "consumer heartbeat time",
    );
    step(0x1016, 1, Job::Read(4), true, "consumer heartbeat time");
    step(0x6007, 0, Job::Write(2, 2), false, "abort connection option code");
    step(0x6007, 0, Job::Read(2), true, "abort connection option code");
    step(0x605e, 0, Job::Write(0, 2), false, "fault reaction option code");
    step(0x605e, 0, Job::Read(2), true, "fault reaction option code");
    step(0x1017, 0, Job::Write(HEARTBEAT_MS, 2), true, "producer heartbeat time");
    let target = if drive.kind == DriveKind::Speed { TARGET_SPEED } else { TARGET_TORQUE };
    let node = u32::from(drive.node);
    // Ours to it carries no bit about remote frames.
    pdo(0x1400, 0x200 + node, &[CONTROL, target], &mut step);
    pdo(0x1800, NOT_ON_REQUEST | (0x180 + node), &[STATUS, MODE, TORQUE], &mut step);
    pdo(0x1801, NOT_ON_REQUEST | (0x280 + node), &[POSITION, SPEED], &mut step);
    // In tenths of a millisecond; a drive without this object reckons by SYNC.
    let tenths = (1e4 / drive.wired.rate_hz).round() as u32;
    let (period, power) = if tenths <= 255 { (tenths, -4) } else { (tenths.div_ceil(10), -3) };
    step(0x60c2, 1, Job::Write(period, 1), false, "interpolation time");
    step(0x60c2, 2, Job::Write(power as u32, 1), false, "interpolation time index");
    step(0x603f, 0, Job::Read(2), false, "error code");
    step(0x6040, 0, Job::Write(state::FAULT_RESET.into(), 2), true, "control word");
    step(0x6040, 0, Job::Write(0, 2), true, "control word");
    steps
}

/// A PDO on every SYNC: off, mapped anew, on. Its mapping stands 0x200 above its communication.
fn pdo(at: u16, id: u32, objects: &[u32], step: &mut impl FnMut(u16, u8, Job, bool, &'static str)) {
    step(at, 1, Job::Write(OFF | id, 4), true, "PDO identifier");
    step(at, 2, Job::Write(1, 1), true, "PDO transmission type");
    step(at + 0x200, 0, Job::Write(0, 1), true, "PDO mapping");
    for (object, sub) in objects.iter().zip(1..) {
        step(at + 0x200, sub, Job::Write(*object, 4), true, "PDO mapping");
    }
    step(at + 0x200, 0, Job::Write(objects.len() as u32, 1), true, "PDO mapping");
    step(at, 1, Job::Write(id, 4), true, "PDO identifier");
}

/// What is learned of the drive on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Learned {
    /// Vendor, product, serial number.
    pub identity: [u32; 3],
    /// Current that a thousand thousandths are, A.
    pub rated_a: f64,
    /// Its consumer heartbeat time as it is.
    pub heartbeat: u32,
    /// Its abort connection option code as it is.
    pub option: u32,
    /// Its last error.
    pub error: u16,
}

impl Learned {
    /// Takes the value of an object, if the drive has it; why it is not to be driven, if it is not.
    pub fn take(&mut self, drive: &Cia402, step: &Step, value: Option<u32>) -> Result<(), String> {
        let Some(value) = value else { return Ok(()) };
        match (step.index, step.sub) {
            (0x1000, _) if value & 0xffff != 402 => Err(format!(
                "its device type (0x1000) is {value:#x}, of profile {}; allowed is profile 402\nhint: `address`: which node is the drive?",
                value & 0xffff
            )),
            (0x1018, sub) => {
                let place = usize::from(sub.min(3)) - 1;
                self.identity.iter_mut().skip(place).take(1).for_each(|kept| *kept = value);
                Ok(())
            }
            (0x6502, _) if value & 1 << (drive.mode() - 1) == 0 => Err(format!(
                "its modes (0x6502) are {value:#x}, without mode {}, cyclic synchronous {}\nhint: newer firmware, or a rig of the other kind (amplifier.kind)",
                drive.mode(),
                if drive.kind == DriveKind::Speed { "velocity" } else { "torque" }
            )),
            (0x6075, _) if value == 0 => {
                Err("its motor rated current (0x6075) is 0 mA\nhint: set the motor up in its own tool".into())
            }
            (0x6075, _) => {
                self.rated_a = f64::from(value) * 1e-3;
                Ok(())
            }
            (0x60a9, _) => match told_units(value, drive.units_per_turn) {
                Some(units) if (units / drive.speed_units - 1.0).abs() > 1e-3 => Err(format!(
                    "its velocity unit (0x60A9) is {value:#010x}, {units} at a turn a second, but `drive.speed_units` is {}\nhint: speed_units = {units}",
                    drive.speed_units
                )),
                _ => Ok(()),
            },
            (0x6061, _) if value != u32::from(drive.mode()) => Err(format!(
                "its mode of operation (0x6061) stays {}; asked for was {}\nhint: is another master, or its own tool, in command?",
                value as i8,
                drive.mode()
            )),
            (0x1016, _) => {
                self.heartbeat = value;
                let (node, ms) = (value >> 16, value & 0xffff);
                if node == u32::from(drive.ours()) && (1..=drive.timeout_ms()).contains(&ms) {
                    return Ok(());
                }
                Err(format!(
                    "its consumer heartbeat time (0x1016:1) stays {value:#x}; allowed is node {}, 1 to {} ms\nhint: does another master hold it? is it writable before operation?",
                    drive.ours(),
                    drive.timeout_ms()
                ))
            }
            (0x6007, _) => {
                self.option = value;
                if matches!(value, 1 | 2) {
                    return Ok(());
                }
                Err(format!(
                    "its abort connection option code (0x6007) stays {}; allowed is 2, disable voltage, or 1, fault\nhint: a drive that goes on without a master, or brakes, is not for this",
                    value as u16 as i16
                ))
            }
            (0x605e, _) if value != 0 => Err(format!(
                "without a master it goes into fault, and its fault reaction (0x605E) stays {}; allowed is 0, the shaft coasts\nhint: set it in its own tool",
                value as u16 as i16
            )),
            (0x603f, _) => {
                self.error = value as u16;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// A step that what was learned makes needless: the reaction to a fault, where silence is none.
    pub fn spares(&self, step: &Step) -> bool {
        step.index == 0x605e && self.option == 2
    }

    /// Vendor, product and serial number as `identity` has them.
    pub fn identity(&self) -> String {
        let [vendor, product, serial] = self.identity;
        format!("{vendor:x}:{product:x}:{serial:x}")
    }
}

/// Velocity units at a turn a second, by the object that tells them: power of ten, length, time. None for lengths of other kinds.
fn told_units(unit: u32, units_per_turn: f64) -> Option<f64> {
    let [_, time, length, power] = unit.to_le_bytes();
    let turn = match length {
        0xb4 => 1.0,
        0xb5 => units_per_turn,
        _ => return None,
    };
    let seconds = match time {
        0x03 => 1.0,
        0x47 => 60.0,
        _ => return None,
    };
    Some(turn * seconds / 10f64.powi((power as i8).into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Synapticon's table of its velocity units.
    #[test]
    fn the_velocity_unit_is_read_as_its_maker_means_it() {
        for (unit, units) in [(0x00b4_4700, 60.0), (0xffb4_4700, 600.0), (0xfdb4_4700, 60_000.0)] {
            let told = told_units(unit, 4096.0).unwrap();
            assert!((told / units - 1.0).abs() < 1e-12, "{unit:#x}: {told}");
        }
        assert_eq!(told_units(0x00b5_0300, 4096.0), Some(4096.0));
        assert_eq!(told_units(0x0000_0000, 4096.0), None);
    }
}
