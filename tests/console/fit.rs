//! A fit from the page: begun, followed, cancelled, read in place, used and gone back from.

use serde_json::{Value, json};

use crate::browser::{Browser, in_its_turn};
use crate::common::jobs::{held, stand_with_tolerances};
use crate::common::{self, Stack};
use crate::{FAINT, text_is};

/// What stands in the rows of a table.
fn rows(page: &mut Browser, id: &str) -> Vec<Vec<String>> {
    let cells = "[...row.cells].map((cell) => cell.textContent)";
    let rows = page.eval(&format!("[...document.querySelectorAll('#{id} tr')].map((row) => {cells})"));
    serde_json::from_value(rows).unwrap()
}

fn text_of(page: &mut Browser, id: &str) -> String {
    page.eval(&format!("$('{id}').textContent")).as_str().unwrap_or_default().to_owned()
}

/// A key that goes down and up again.
fn press(page: &mut Browser, key: &str) {
    let (code, number, text) = match key {
        " " => ("Space", 32, " "),
        "Enter" => ("Enter", 13, "\r"),
        "Tab" => ("Tab", 9, ""),
        "ArrowUp" => ("ArrowUp", 38, ""),
        other => panic!("{other}"),
    };
    let event = |kind: &str, text: &str| json!({"type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number, "text": text});
    page.call("Input.dispatchKeyEvent", event(if text.is_empty() { "rawKeyDown" } else { "keyDown" }, text));
    page.call("Input.dispatchKeyEvent", event("keyUp", ""));
}

/// The focus on a button that can be pressed: one that is off, as all are while the page's state is old, takes none.
fn focus(page: &mut Browser, id: &str) {
    page.until(&format!("!$('{id}').disabled && ($('{id}').focus(), document.activeElement === $('{id}'))"));
}

/// From the button before them on: the model's list, the summary, the first boxes behind it.
fn chosen_by_keys(page: &mut Browser) {
    page.eval("$('diagnosis-of').value = '60'");
    focus(page, "fit");
    let reach = |page: &mut Browser, what: &str| {
        for _ in 0..70 {
            if page.eval(&format!("document.activeElement === {what}")) == json!(true) {
                return;
            }
            press(page, "Tab");
        }
        panic!("Tab does not reach {what}");
    };
    reach(page, "$('analysis-model')");
    press(page, "ArrowUp");
    page.until("$('analysis-model').value === 'model1'");
    reach(page, "$('known').querySelector('summary')");
    press(page, "Enter");
    page.until("$('known').open");
    reach(page, "document.querySelector('#known-effects input[value=coulomb_friction]')");
    press(page, " ");
    page.until(&text_is("known-text", "coulomb friction"));
    let named = page.eval("[...document.querySelectorAll('#known-effects input, #analysis-model')].every((field) => field.labels.length && field.labels[0].textContent.trim())");
    assert_eq!(named, json!(true), "every field has a label");
    // No more than the service takes; what is chosen can be taken back.
    page.eval("[...document.querySelectorAll('#known-effects input:not(:checked)')].slice(0, 7).forEach((box) => box.click())");
    assert_eq!(page.eval("document.querySelectorAll('#known-effects input:enabled').length"), json!(8));
    for (theme, width) in [("light", 1280), ("dark", 390)] {
        page.show_as(theme, width);
        page.eval("$('known').scrollIntoView()");
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= width, "{theme} at {width} px: the page is {wide} px wide");
        page.picture(&format!("{}/target/console-known-{theme}-{width}.png", env!("CARGO_MANIFEST_DIR")));
    }
    page.eval("document.querySelectorAll('#known-effects input:checked:not([value=coulomb_friction])').forEach((box) => box.click())");
}

#[test]
fn an_operator_fits_reads_and_uses_what_was_fitted() {
    in_its_turn(|| {
        let mut stack = Stack::start();
        for newton in [60.0, -60.0, 120.0, 20.0, -100.0, 80.0] {
            stack.thrust(newton, 60_000);
            std::thread::sleep(std::time::Duration::from_millis(1200));
        }
        let known = [
            ("lift_max", 0.15),
            ("drag_max", 0.3),
            ("flux_coefficient", 0.2),
            ("inertia_kg_m2", 0.5),
            ("torque_constant_nm_a", 0.1),
        ];
        stack.expect("POST", "/rig", Some(json!({"toml": stand_with_tolerances(&known)})));
        // Whoever holds the lease says which rig is in force: here that is the page.
        stack.expect("DELETE", "/lease", None);
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.until(&text_is("rig-text", "revision 2"));
        assert_eq!(page.eval("$('use-fit').disabled"), json!(true), "there is nothing to use yet");
        page.eval("$('diagnosis-of').value = '60'");
        let pid = held(&stack, "fit", || page.click("fit"));
        page.until(&text_is("fit-text", "Fit: "));
        page.until("$('diagnose').disabled && $('fit').disabled && !$('diagnosis-cancel').disabled");
        page.until(&text_is("fit-time", "s so far"));
        common::kill(pid, "CONT");

        page.until("fitted !== null && fitted.state === 'done' && state.fit === null");
        page.until(&text_is("fit-text", ": 5 values of model2 fitted to the last"));
        let found = rows(&mut page, "fitted");
        // What the fit needs for itself is nobody's business.
        let told = text_of(&mut page, "fit-text") + &text_of(&mut page, "fit-open");
        assert!(!told.contains("sampling_delay_s") && !told.contains("averaging_s"), "{told}");
        let warns = page.eval("leftOver({ usable: true, heldout: [{ channel: 'thrust_n', nrmse: 0.1, noise_floor: 0.002, white: false }] })");
        assert!(warns.as_str().unwrap().contains("thrust 10 % of full scale, 50 times its noise"), "{warns}");
        let lift = found.iter().find(|row| row[0] == "lift_max").unwrap_or_else(|| panic!("{found:?}"));
        assert_eq!((lift[1].as_str(), lift[3].as_str()), ("0.542 ± 15 %", "1"), "{lift:?}");
        let (value, doubt) = lift[2].split_once(" ± ").unwrap_or_else(|| panic!("{lift:?}"));
        let (value, doubt): (f64, f64) = (value.parse().unwrap(), doubt.parse().unwrap());
        assert!((value - 0.542).abs() < 0.1 && doubt > 0.0, "{lift:?}");
        let left = rows(&mut page, "heldout");
        assert!(left.iter().any(|row| row[0] == "shaft_speed_rad_s" && row[1].ends_with(" %")), "{left:?}");
        let open = page.eval("fitted.not_identifiable.map((group) => [group.parameters.join(', '), group.why, group.excitation])");
        assert_eq!(json!(rows(&mut page, "fit-open")), open);

        // A screen reader is told of the end; on a phone nothing is cut off; what is new can be read in both themes.
        assert_eq!(page.eval("$('fit-text').getAttribute('role')"), json!("status"));
        for (theme, width) in [("light", 1280), ("dark", 1280), ("light", 390), ("dark", 390)] {
            page.show_as(theme, width);
            page.eval("$('fit').closest('section').scrollIntoView()");
            let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
            assert!(wide <= width, "{theme} at {width} px: the page is {wide} px wide");
            let within = page.eval("[...document.querySelectorAll('#fitted, #heldout, #fit-open')].every((body) => body.clientWidth <= body.closest('section').clientWidth)");
            assert_eq!(within, json!(true), "{theme}, {width} px");
            page.picture(&format!("{}/target/console-fit-{theme}-{width}.png", env!("CARGO_MANIFEST_DIR")));
        }
        for theme in ["light", "dark"] {
            page.show_as(theme, 1280);
            assert_eq!(page.eval(FAINT)["faint"], json!([]), "{theme}: text below 4.5:1");
        }

        // Another model, and an effect taken as known: reached and chosen by the keyboard alone.
        chosen_by_keys(&mut page);
        focus(&mut page, "fit");
        press(&mut page, "Enter");
        page.until("fitted?.model === 'model1' && state.fit === null");
        page.until(
            "[...$('fitted').rows].some((row) => row.cells[0].textContent.endsWith('of coulomb_friction'))",
        );
        assert!(text_of(&mut page, "fitted-of").starts_with("values of model1"));
        page.eval("$('analysis-model').value = 'model2'; for (const box of document.querySelectorAll('#known-effects input:checked')) box.click()");
        assert_eq!(text_of(&mut page, "known-text"), "nothing beyond the rig description");
        page.click("fit");
        page.until("fitted?.model === 'model2' && state.fit === null");
        page.until(&text_is("fit-text", ": 5 values of model2 fitted to the last"));
        let found = rows(&mut page, "fitted");

        // What differs is shown before it is agreed to, as for a diagnosis.
        page.eval("window.confirm = (words) => { window.agreed = words; return true; }");
        page.click("use-fit");
        page.until(&text_is("rig-text", "revision 3 of the rig, from fit "));
        let agreed: Value = page.eval("agreed");
        assert!(agreed.as_str().unwrap().contains("propeller.lift_max: 0.542 (± 15 %) → "), "{agreed}");
        page.until("$('use-fit').disabled");
        page.click("back");
        page.until(&text_is("rig-text", "revision 2"));

        // One that is cancelled takes nothing away from the one before.
        held(&stack, "fit", || page.click("fit"));
        page.click("diagnosis-cancel");
        page.until(&text_is("fit-text", ": cancelled. "));
        page.until(&text_is("log", "fit cancelled"));
        assert_eq!(rows(&mut page, "fitted"), found);
        assert_eq!(page.errors, Vec::<String>::new());
    });
}
