//! What shared memory carries is whatever another process wrote there: every bit pattern is a value of every message,
//! and reading it is defined. `just miri` runs this under miri, which sees what a test alone cannot.

use std::fmt::{Debug, Write};
use std::mem::MaybeUninit;

use kort_proto::messages::{
    Command, ControllerState, DriveKind, Freshness, Outcome, Process, Reply, Request, RequestKind, Setpoint,
    SetpointKind, Telemetry,
};
use kort_proto::signals::{ESTIMATES, SIGNALS};
use kort_proto::text::Text;
use proptest::prelude::*;

/// A message as it comes out of a slot that holds these bytes, repeated.
fn out_of_a_slot<T: Copy + Debug>(bytes: &[u8]) -> T {
    let mut slot = MaybeUninit::<T>::uninit();
    for (at, byte) in bytes.iter().cycle().take(size_of::<T>()).enumerate() {
        // SAFETY: `at` is within the slot, and bytes may be written at any place of it.
        unsafe { slot.as_mut_ptr().cast::<u8>().add(at).write(*byte) };
    }
    // SAFETY: this is what is tested: messages are `repr(C)` of numbers and arrays of numbers, for which every bit
    // pattern is a value. A `bool` or an enumeration among them would be undefined behaviour here and in the service.
    let message = unsafe { slot.assume_init() };
    let copy = message;
    assert!(!format!("{copy:?}").is_empty());
    message
}

fn cases() -> ProptestConfig {
    // miri is some hundred times slower, and must not look for files of past failures.
    if cfg!(miri) {
        ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() }
    } else {
        ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn any_bytes_are_a_message(bytes in prop::collection::vec(any::<u8>(), 1..64), now_ns in any::<u64>()) {
        let telemetry: Telemetry = out_of_a_slot(&bytes);
        for row in SIGNALS {
            let mut signals = telemetry.signals;
            (row.set)(&mut signals, (row.get)(&telemetry.signals));
        }
        let state: ControllerState = out_of_a_slot(&bytes);
        for row in ESTIMATES {
            (row.get)(&state.estimates);
        }
        prop_assert!(state.law.as_str().len() <= size_of_val(&state.law));
        let command: Command = out_of_a_slot(&bytes);
        let _ = (Freshness::default().check(&command.header, now_ns, 70_000_000), DriveKind::from_u32(command.kind));
        let _ = SetpointKind::from_u32(out_of_a_slot::<Setpoint>(&bytes).kind);
        let _ = RequestKind::from_u32(out_of_a_slot::<Request>(&bytes).kind);
        let reply: Reply = out_of_a_slot(&bytes);
        let _ = (Process::from_u32(reply.from), Outcome::from_u32(reply.outcome));
        prop_assert!(std::str::from_utf8(reply.message.as_str().as_bytes()).is_ok());
    }

    #[test]
    fn any_bytes_are_a_text(bytes in prop::collection::vec(any::<u8>(), 1..40), more in ".{0,12}") {
        let mut text: Text<24> = out_of_a_slot(&bytes);
        let before = text.as_str().len();
        let written = text.write_str(&more);
        prop_assert!(written.is_ok());
        prop_assert!(text.as_str().len() >= before.min(24));
    }
}
