//! What is known of the vehicle, and whether it may be driven now.

use mavlink::dialects::ardupilotmega::{MavResult, SERVO_OUTPUT_RAW_DATA};

/// Pulse width that is zero, and the one from there to full, us.
pub const ZERO_US: u16 = 1500;
pub const SPAN_US: f64 = 400.0;
/// ArduSub's mode in which no controller of its own moves a thruster.
const MANUAL: u32 = 19;
/// Outputs in a message.
pub const OUTPUTS: usize = 16;
/// `SERVOn_FUNCTION` of motors 1 to 8, and 9 to 12.
const FUNCTIONS: [(u32, u32); 2] = [(1, 33), (9, 82)];
/// The end of a motor test by its time-out, and the vehicle's cool-down after it, us.
const COOLING_US: u64 = 500_000 + 10_000_000 + 100_000;
/// Its clock tells itself many times within this, us.
const NEAR_US: u32 = 5_000_000;
/// An output may differ from what was sent for so many messages: what is on its way.
const LATE: u32 = 25;

/// Whose the vehicle is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Hold {
    /// Its own, and its pilot's.
    #[default]
    Free,
    /// kort has asked for it.
    Taking,
    /// Armed by kort, motor test under way.
    Held,
    /// kort gives it back: at zero, until it says that it is disarmed.
    Giving,
}

/// The vehicle.
#[derive(Clone, Debug, Default)]
pub struct Vehicle {
    /// Whose it is.
    pub hold: Hold,
    /// kort wants to drive.
    pub wanted: bool,
    /// Armed, by its last word.
    pub armed: bool,
    mode: Option<u32>,
    /// Its last warning.
    text: String,
    /// Time since its first word, by its own clock, us, and that clock as it was told.
    clock_us: u64,
    told_us: Option<u32>,
    cool_us: u64,
    refused: Option<String>,
    /// Motor on each output, from 1; zero: none; absent: not told yet.
    motors: [Option<u32>; OUTPUTS],
    /// Pulse widths at the outputs, us.
    widths: [u16; OUTPUTS],
    /// The last widths sent, and messages since the output showed none of them.
    sent: [u16; 8],
    late: u32,
}

/// What its clock says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// It goes on.
    On,
    /// It stands: an old message.
    Old,
    /// It went back: it was reset.
    Back,
}

impl Vehicle {
    /// A new conversation. The vehicle's clock goes on, and so does its cool-down: one that was held will begin it.
    pub fn begin(&mut self) {
        let Self { clock_us, told_us, .. } = *self;
        let cool_us = if self.hold == Hold::Free { self.cool_us } else { clock_us + COOLING_US };
        *self = Self { clock_us, told_us, cool_us, ..Self::default() };
    }

    /// It was reset: its clock begins anew, and nothing is left of a cool-down.
    pub fn was_reset(&mut self) {
        *self = Self::default();
    }

    /// Outputs whose function is not known yet, from 1.
    pub fn unknown(&self) -> impl Iterator<Item = usize> {
        let unknown = |(i, motor): (usize, &Option<u32>)| motor.is_none().then_some(i + 1);
        self.motors.iter().enumerate().filter_map(unknown)
    }

    /// Its clock as told last, us since its first word.
    pub fn clock_us(&self) -> u64 {
        self.clock_us
    }

    /// The same for an instant near it, of its clock since its start, us; none if that is another clock.
    pub fn clock_at(&self, since_start_us: u64) -> Option<u64> {
        let from_told = (since_start_us as u32).wrapping_sub(self.told_us?) as i32;
        let near = from_told.unsigned_abs() <= NEAR_US;
        near.then(|| self.clock_us.saturating_add_signed(from_told.into()))
    }

    /// Place of a motor's output, from zero.
    pub fn output_of(&self, motor: u32) -> Option<usize> {
        self.motors.iter().position(|m| *m == Some(motor))
    }

    /// `SERVOn_FUNCTION` of output `n`, from 1.
    pub fn function(&mut self, n: usize, function: u32) {
        let motor = FUNCTIONS.iter().rev().find_map(|(motor, first)| {
            let last = if *motor == 1 { 8 } else { 4 };
            (*first..first + last).contains(&function).then(|| motor + function - first)
        });
        if let Some(place) = n.checked_sub(1).and_then(|i| self.motors.get_mut(i)) {
            *place = Some(motor.unwrap_or(0));
        }
    }

    /// Its heartbeat.
    pub fn heartbeat(&mut self, armed: bool, mode: u32) {
        self.armed = armed;
        self.mode = Some(mode);
        if !armed && self.hold == Hold::Giving {
            self.freed();
        }
    }

    /// Its warning.
    pub fn says(&mut self, text: String) {
        self.text = text;
    }

    /// The pulse widths that go out.
    pub fn outputs(&mut self, all: &SERVO_OUTPUT_RAW_DATA, output: usize) -> Clock {
        let passed = self.told_us.map(|before| all.time_usec.wrapping_sub(before));
        match passed {
            Some(0) => return Clock::Old,
            // Half a turn of the counter, 36 minutes, is no pause.
            Some(passed) if passed > u32::MAX / 2 => return Clock::Back,
            passed => self.clock_us += u64::from(passed.unwrap_or(0)),
        }
        self.told_us = Some(all.time_usec);
        self.widths = [
            all.servo1_raw,
            all.servo2_raw,
            all.servo3_raw,
            all.servo4_raw,
            all.servo5_raw,
            all.servo6_raw,
            all.servo7_raw,
            all.servo8_raw,
            all.servo9_raw,
            all.servo10_raw,
            all.servo11_raw,
            all.servo12_raw,
            all.servo13_raw,
            all.servo14_raw,
            all.servo15_raw,
            all.servo16_raw,
        ];
        let shown = self.widths.get(output).copied().unwrap_or(0);
        self.late = if self.hold != Hold::Held || self.sent.contains(&shown) {
            0
        } else {
            self.late.saturating_add(1)
        };
        Clock::On
    }

    /// Share of the supply that an output gives, -1 to 1.
    pub fn share(&self, output: usize) -> f64 {
        let width = self.widths.get(output).copied().unwrap_or(ZERO_US);
        if width == 0 { 0.0 } else { (f64::from(width) - f64::from(ZERO_US)) / SPAN_US }
    }

    /// A width is on its way.
    pub fn sends(&mut self, width: u16) {
        self.sent.rotate_right(1);
        if let Some(first) = self.sent.first_mut() {
            *first = width;
        }
    }

    /// Its answer to a wish to be armed or disarmed.
    pub fn arming(&mut self, result: MavResult) {
        match (self.hold, result) {
            (Hold::Taking | Hold::Held, MavResult::MAV_RESULT_ACCEPTED) => self.armed = true,
            (Hold::Giving, MavResult::MAV_RESULT_ACCEPTED) => {
                self.armed = false;
                self.freed();
            }
            (Hold::Taking, MavResult::MAV_RESULT_IN_PROGRESS) => (),
            (Hold::Taking, _) => self.refuse("it does not let itself be armed"),
            _ => (),
        }
    }

    /// Its answer to a motor test.
    pub fn testing(&mut self, result: MavResult) {
        match (self.hold, result) {
            (Hold::Taking, MavResult::MAV_RESULT_ACCEPTED) => self.hold = Hold::Held,
            (_, MavResult::MAV_RESULT_ACCEPTED | MavResult::MAV_RESULT_IN_PROGRESS) => (),
            (Hold::Taking, _) => self.refuse("it refuses the motor test"),
            (Hold::Held, _) => {
                self.refuse("it ended the motor test: disarmed by a pilot, a fail-safe or its time-out");
            }
            _ => (),
        }
    }

    fn refuse(&mut self, words: &str) {
        if self.refused.is_none() {
            self.refused = Some(format!("{words}{}", self.own_words()));
        }
    }

    fn own_words(&self) -> String {
        if self.text.is_empty() { String::new() } else { format!(": \"{}\"", self.text) }
    }

    fn freed(&mut self) {
        self.hold = Hold::Free;
        self.cool_us = self.clock_us + COOLING_US;
    }

    /// It has said no, and is not asked again before kort wants anew.
    pub fn is_refused(&self) -> bool {
        self.refused.is_some()
    }

    /// kort wants it, or does not any more.
    pub fn want(&mut self, wanted: bool) {
        if wanted && !self.wanted {
            (self.refused, self.late) = (None, 0);
            self.text.clear();
        }
        self.wanted = wanted;
        self.hold = match self.hold {
            Hold::Free
                if wanted && !self.armed && self.mode == Some(MANUAL) && self.cool_us <= self.clock_us =>
            {
                Hold::Taking
            }
            Hold::Taking | Hold::Held if !wanted => Hold::Giving,
            hold => hold,
        };
        if !wanted && self.hold == Hold::Free {
            self.refused = None;
        }
    }

    /// Why it is not to be driven, or must not go on.
    pub fn fault(&self, motor: u32) -> Option<String> {
        if let Some(words) = &self.refused {
            return Some(format!("{words}\nhint: QGroundControl shows what stands against it"));
        }
        if let Some(mode) = self.mode.filter(|mode| *mode != MANUAL) {
            return Some(format!(
                "it is in mode {mode}, and is driven in MANUAL ({MANUAL}) only{}\nhint: a pilot or a fail-safe changed it; set MANUAL in the ground station",
                self.own_words()
            ));
        }
        match self.hold {
            Hold::Free if self.armed => {
                return Some(
                    "somebody else has armed it\nhint: disarm it in the ground station; kort arms it itself"
                        .into(),
                );
            }
            Hold::Free if self.wanted && self.cool_us > self.clock_us => {
                let left_s = (self.cool_us - self.clock_us).div_ceil(1_000_000);
                return Some(format!(
                    "it begins no motor test for {left_s} s more: its own cool-down\nhint: wait, clear the fault, arm"
                ));
            }
            Hold::Held if !self.armed => {
                return Some(format!(
                    "it disarmed itself{}\nhint: one of its fail-safes, a pilot, or its time-out; QGroundControl tells",
                    self.own_words()
                ));
            }
            Hold::Held if self.late > LATE => {
                return Some(
                    "its output does not show what was commanded\nhint: safety switch, or another program on the motors".into(),
                );
            }
            _ => (),
        }
        let moved = |(i, width): (usize, &u16)| {
            let other = self.motors.get(i).copied().flatten().filter(|other| *other != 0 && *other != motor);
            other.filter(|_| *width != 0 && width.abs_diff(ZERO_US) > 1)
        };
        let other = self.widths.iter().enumerate().find_map(moved).filter(|_| self.hold == Hold::Held)?;
        Some(format!(
            "motor {other} moves too, and one time-out guards all\nhint: one thruster of a vehicle at a time; stop the other program"
        ))
    }
}
