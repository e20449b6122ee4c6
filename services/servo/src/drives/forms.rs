//! How ports and numbers of drives are written: what can be seen to be none before anything is opened.

use std::path::Path;

/// How a value is written.
#[derive(Clone, Copy, Debug)]
pub struct Form {
    /// Is it written so?
    pub fits: fn(&str) -> bool,
    /// What is allowed.
    pub allowed: &'static str,
    /// What to do.
    pub hint: &'static str,
}

impl Form {
    /// Words for a value that is not written so; they go on behind its key.
    ///
    /// # Errors
    /// The value, what is allowed and what to do.
    pub fn check(&self, value: &str) -> Result<(), String> {
        if (self.fits)(value) {
            return Ok(());
        }
        Err(format!("= {value:?}; allowed is {}\nhint: {}", self.allowed, self.hint))
    }
}

/// What a number's hint says of it.
const TOLD: &str =
    "the servo's log tells it when the drive answers; leave the key out to take whichever answers";

/// A serial port, or an USB device that looks like one.
pub const DEVICE: Form = Form {
    fits: is_device,
    allowed: "the whole path of a device",
    hint: "best by its serial number: /dev/serial/by-id/…",
};

/// The same, or a vehicle's endpoint, whose address is looked at where it is taken apart.
pub const DEVICE_OR_UDP: Form = Form {
    fits: |port| port.starts_with("udp:") || is_device(port),
    allowed: "the whole path of a device, or udp: with address and port",
    hint: "/dev/serial/by-id/… or \"udp:192.168.2.2:14550\"",
};

/// The same, or a CAN interface of the system.
pub const DEVICE_OR_INTERFACE: Form = Form {
    fits: |port| is_interface(port) || is_device(port),
    allowed: "the name of a CAN interface (1 to 15 characters), or the whole path of an adapter's device",
    hint: "\"can0\" (`ip link` lists them), or /dev/serial/by-id/…",
};

/// 96 bits.
pub const NUMBER_OF_24: Form =
    Form { fits: |number| is_hex(number, &[24]), allowed: "24 hexadecimal digits", hint: TOLD };

/// 48 bits.
pub const NUMBER_OF_12: Form =
    Form { fits: |number| is_hex(number, &[12]), allowed: "12 hexadecimal digits", hint: TOLD };

/// The UID of an autopilot, the long one or the short one.
pub const NUMBER_OF_36_OR_16: Form =
    Form { fits: |number| is_hex(number, &[36, 16]), allowed: "36 or 16 hexadecimal digits", hint: TOLD };

/// Vendor, product and serial number of a CANopen device (object 0x1018).
pub const NUMBER_OF_CANOPEN: Form = Form {
    fits: is_canopen,
    allowed: "vendor:product:serial, each of 1 to 8 hexadecimal digits without leading zeros",
    hint: TOLD,
};

/// A device of the kernel's by its file `name`.
pub const NAME: Form = Form {
    fits: |name| {
        !name.is_empty() && !name.contains(|c: char| c.is_whitespace() || c.is_control() || c == '/')
    },
    allowed: "a name without blanks and slashes",
    hint: "what the file `name` in the device's folder holds; leave the key out to take whichever is there",
};

fn is_device(port: &str) -> bool {
    let whole = Path::new(port).is_absolute() && !port.ends_with('/');
    whole && !port.contains(char::is_control) && Path::new(port).file_name().is_some()
}

/// As the kernel takes them (`dev_valid_name`).
fn is_interface(name: &str) -> bool {
    let odd = |c: char| c == '/' || c == ':' || c.is_whitespace() || c.is_control();
    (1..=15).contains(&name.len()) && name != "." && name != ".." && !name.contains(odd)
}

fn is_hex(number: &str, digits: &[usize]) -> bool {
    digits.contains(&number.len()) && number.bytes().all(|b| b.is_ascii_hexdigit())
}

fn is_canopen(number: &str) -> bool {
    let parts: Vec<&str> = number.split(':').collect();
    // As the drive is told: what is written otherwise is never the same text.
    let as_told = |part: &&str| {
        u32::from_str_radix(part, 16).is_ok_and(|n| format!("{n:x}").eq_ignore_ascii_case(part))
    };
    parts.len() == 3 && parts.iter().all(as_told)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_so_fits_and_nothing_else() {
        for (form, good, bad) in [
            (
                DEVICE,
                &["/dev/ttyACM0", "/dev/serial/by-id/usb-ÄB_1-if00"][..],
                &["", "ttyACM0", "dev/a", "/", "/dev/", "/dev/..", "/dev/a\n", "udp:1.2.3.4:5", "can0"][..],
            ),
            (DEVICE_OR_UDP, &["/dev/a", "udp:1.2.3.4:5"], &["", "tcp:1.2.3.4:5", "can0"]),
            (
                DEVICE_OR_INTERFACE,
                &["can0", "vcan12", "/dev/ttyACM0"],
                &["", "can 0", "dev/a", "..", "a-name-too-long-", "udp:1.2.3.4:5"],
            ),
            (
                NUMBER_OF_24,
                &["3e0041000751363532393532", "3E0041000751363532393532"],
                &["", "0011", "3e00410007513635323935zz", "0x3e00410007513635323935"],
            ),
            (NUMBER_OF_12, &["2084377D3548"], &["", "2084377D354", " 2084377D3548"]),
            (NUMBER_OF_36_OR_16, &["0123456789abcdef"], &["", "0123456789abcde"]),
            (
                NUMBER_OF_CANOPEN,
                &["9a:30924:0", "9A:30924:1"],
                &["", "9a:30924", "9a:30924:", "09a:30924:1", "9a:30924:1:2", "1ffffffff:1:1", "+9:1:1"],
            ),
            (NAME, &["ad5754r", "mcp4725-2"], &["", " ", "ad5754r\n", "/sys/a"]),
        ] {
            for value in good {
                assert_eq!(form.check(value), Ok(()), "{value}");
            }
            for value in bad {
                let words = form.check(value).unwrap_err();
                assert!(words.contains("; allowed is ") && words.contains("\nhint: "), "{words}");
            }
        }
    }
}
