//! Revisions of the rig: what they do to the thrust is told, and gone back from.

use std::time::Duration;

use serde_json::json;

use crate::browser::{Browser, in_its_turn};
use crate::common::Stack;
use crate::text_is;

/// A revision of the rig that makes the thrust worse is told at the top of the page, and one button goes back, under way.
#[test]
fn an_operator_is_told_of_a_worse_revision_and_goes_back() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.until(&text_is("rig-text", "revision 1"));
        page.eval("lease_ttl_ms = 60000");
        page.click("take");
        page.until(&text_is("lease-text", "You have the lease"));
        page.click("arm");
        page.until("state.armed");
        page.eval("document.getElementById('entry').value = 60");
        page.click("send");
        page.until("Math.abs(state.measured.thrust_n - 60) < 6");
        assert_eq!(
            page.eval("$('worse').hidden"),
            json!(true),
            "nothing is said of a rig that was not revised"
        );
        // Ten seconds of like command are compared, at the least.
        std::thread::sleep(Duration::from_secs(12));
        let rig = include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml");
        let worse = rig.replace("value = 0.542", "value = 1.0");
        assert_ne!(rig, worse);
        page.eval(&format!("void call('POST', `${{base()}}/rig`, {})", json!({ "toml": worse })));
        page.until(&text_is("rig-text", "revision 2"));
        assert_eq!(page.eval("$('worse').hidden"), json!(true), "nothing is said before it was driven");
        page.until("!$('worse').hidden");
        page.until(&text_is("worse-text", "larger since revision 2"));
        page.click("worse-back");
        page.until(&text_is("rig-text", "revision 1"));
        page.until("$('worse').hidden && Math.abs(state.measured.thrust_n - 60) < 6");
        assert_eq!(page.eval("state.armed"), json!(true), "it was driving all the time");
        page.until(&text_is("events", "the thrust error is larger since revision 2"));
        // A page that is opened later knows when it was.
        page.eval("window.old = true; location.reload()");
        page.until("window.old === undefined && document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.click("overlay");
        page.until("run !== null && run.b.rms('thrust_error_n') !== null");
        let rms = page.eval("[run.a, run.b].map((one) => one.rms('thrust_error_n'))");
        assert!(rms[0].as_f64() > rms[1].as_f64(), "the way back makes it better: {rms}");
        page.until(&text_is("run-text", "since revision 1"));
        assert_eq!(page.errors, Vec::<String>::new());
    });
}
