//! What a bench engineer keeps and compares at the console: tags, controller files, several thrusters side by side.

use serde_json::json;

use crate::browser::{Browser, in_its_turn};
use crate::common::{Site, Stack, wait};
use crate::text_is;

/// Recordings are tagged and found by it; law, observer and parameters go to a file and come from one.
#[test]
fn recordings_are_tagged_and_the_tuned_controller_is_kept_as_a_file() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        // A connection that was lost for a while leaves no hole: the gateway kept what was measured meanwhile.
        page.until("live.t.length > 20");
        page.eval("window.cut_s = state.time_s; socket.close()");
        page.until("state.time_s > cut_s + 1");
        page.until("live.t.some((t) => t > cut_s + 0.3 && t < cut_s + 0.7)");
        let order = "live.t.every((t, i) => i === 0 || t > live.t[i - 1]) && live.c.thrust_n.length === live.t.length";
        assert_eq!(page.eval(order), json!(true), "rows stand in their order");
        for (name, tags) in [("first", "bollard, dry"), ("second", "tow")] {
            page.eval(&format!("$('recording-name').value = '{name}'; $('recording-tags').value = '{tags}'"));
            page.click("record");
            page.until(&text_is("record", "Stop"));
            page.click("record");
            page.until(&text_is("record", "Start"));
        }
        let entry = |name: &str| {
            format!(
                "[...document.querySelectorAll('#recordings input')].find((i) => i.ariaLabel === 'tags of {name}')"
            )
        };
        page.until(&format!("{}.value === 'bollard dry'", entry("first")));
        page.eval(&format!(
            "(() => {{ const i = {}; i.value = 'tow new-propeller'; i.dispatchEvent(new Event('change')); }})()",
            entry("second")
        ));
        page.until(&text_is("log", "recording second: tow, new-propeller"));
        let list = stack.get("/v1/recordings?tag=new-propeller").unwrap();
        assert_eq!((list.as_array().unwrap().len(), &list[0]["name"]), (1, &json!("second")));
        page.eval("$('recording-filter').value = 'bollard'; $('recording-filter').dispatchEvent(new Event('input'))");
        page.until("document.querySelectorAll('#recordings tr').length === 1");
        page.until(&format!("{} !== undefined", entry("first")));
        page.eval(&format!(
            "(() => {{ const i = {}; i.value = 'no/slash'; i.dispatchEvent(new Event('change')); }})()",
            entry("first")
        ));
        page.until(&text_is("log", "outside its allowed range"));
        page.until(&format!("{}.value === 'bollard dry'", entry("first")));

        // Tuned, kept, changed, and back from the file.
        page.eval("$('controller').value = 'thrust_pi'; $('observer').value = 'luenberger'");
        // An answer that was asked for before a value was changed, and comes after it, does not bring the old one back.
        page.eval("(() => { const now = fetch, released = new Promise((on) => { window.release = on; }); window.late = 0; window.holds = true; window.fetch = async (url, how) => { const held = holds && String(url).endsWith('/controller') && how?.method === 'GET', answer = await now(url, how); if (held) { late += 1; await released; late -= 1; } return answer; }; })()");
        page.click("switch");
        page.until("state.controller === 'thrust_pi' && state.observer === 'luenberger' && late > 0");
        page.eval("holds = false");
        // What the law in force uses comes first, the rest is folded.
        page.until("[...document.querySelectorAll('#law-parameters input')].some((i) => i.ariaLabel.startsWith('thrust_pi_bandwidth_ratio')) && [...document.querySelectorAll('#other-parameters input')].some((i) => i.ariaLabel.startsWith('look_ahead_horizon'))");
        let margin = "[...document.querySelectorAll('#law-parameters input')].find((i) => i.ariaLabel.startsWith('phase_margin_deg in deg, 30 to 85'))";
        let tune = |page: &mut Browser, value: &str| {
            page.eval(&format!("(() => {{ const i = {margin}; i.value = '{value}'; i.dispatchEvent(new Event('change')); }})()"));
        };
        page.until(&format!("{margin} !== undefined"));
        tune(&mut page, "61");
        page.until(&text_is("log", "phase_margin_deg = 61 deg"));
        page.eval("window.kept = null; save = (name, blob) => { blob.text().then((text) => { window.kept = [name, text]; }); }");
        page.click("controller-save");
        page.until("window.kept !== null");
        assert_eq!(page.eval("window.kept[0]"), "t1-thrust_pi.toml");
        let text = page.eval("window.kept[1]").as_str().unwrap().to_owned();
        assert!(text.contains("phase_margin_deg = 61") && text.contains("law = \"thrust_pi\""), "{text}");
        page.eval("release()");
        page.until(&format!("late === 0 && {margin}.value === '61'"));
        // An emptied field is no zero.
        tune(&mut page, "");
        assert_eq!(page.eval(&format!("{margin}.value")), "61");
        tune(&mut page, "45");
        page.until(&text_is("log", "phase_margin_deg = 45 deg"));
        // A file as the dialog hands it over.
        page.eval("(() => { const chosen = new DataTransfer(); chosen.items.add(new File([window.kept[1]], 'mine.toml')); $('controller-file').files = chosen.files; $('controller-file').dispatchEvent(new Event('change')); })()");
        page.until(&text_is("log", "mine.toml is in force: thrust_pi"));
        page.until(&format!("{margin} && {margin}.value === '61'"));
        assert_eq!(
            page.errors.iter().filter(|e| !e.contains("status of 422")).collect::<Vec<_>>(),
            Vec::<&String>::new()
        );
    });
}

/// Two thrusters beside each other: what one commands goes on while one looks at the other, and one stop ends both.
#[test]
fn two_thrusters_side_by_side_are_commanded_in_turn_and_stopped_at_once() {
    in_its_turn(|| {
        let stack = Stack::start_at(Site::new().with_t2());
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.until(
            "!$('fleet').hidden && fleet.size === 2 && [...fleet.values()].every((m) => m.state !== null)",
        );
        page.until("[...fleet.values()].every((m) => m.plot?.axes[1]._splits.length >= 2)");
        page.eval("lease_ttl_ms = 5000");
        // A gateway that answers late: the signal of the larger thruster is not asked of the smaller one meanwhile.
        page.eval("(() => { const now = fetch; window.fetch = (url, ...how) => String(url).endsWith('/t2') ? new Promise((on) => setTimeout(on, 600)).then(() => now(url, ...how)) : now(url, ...how); })()");
        for (id, newton) in [("t1", 60), ("t2", 15)] {
            page.eval("preview()");
            page.eval(&format!("[...document.querySelectorAll('#mates button')].find((b) => b.ariaLabel === 'choose {id}').click()"));
            page.until(&format!("thruster === '{id}' && state !== null"));
            // Nothing of the one before is shown, or proposed, as this one's.
            assert_eq!(page.eval("[state.id, Number($('entry').value)]"), json!([id, 0]));
            page.click("take");
            page.until(&text_is("lease-text", "You have the lease"));
            page.click("arm");
            page.until("state.armed");
            page.eval(&format!("document.getElementById('entry').value = {newton}"));
            page.click("send");
            page.until(&format!("state.setpoint.thrust_n === {newton}"));
        }
        page.until(
            "Math.abs(fleet.get('t1').state.measured.thrust_n - 60) < 8 && fleet.get('t2').state.armed",
        );
        // Longer than the lease of the one that is not looked at: its renewal goes on.
        std::thread::sleep(std::time::Duration::from_millis(6500));
        for (id, newton) in [("t1", 60.0), ("t2", 15.0)] {
            let state = stack.get(&format!("/v1/thrusters/{id}")).unwrap();
            assert_eq!(
                (&state["armed"], state["setpoint"]["thrust_n"].as_f64()),
                (&json!(true), Some(newton))
            );
            assert_eq!(state["lease"]["holder"], "console", "{state}");
        }
        page.until("document.querySelectorAll('#mates section').length === 2");
        page.until("[...document.querySelectorAll('#mates .by')].every((by) => by.textContent.includes('this page has the lease'))");
        let drawn =
            page.eval("[...fleet.values()].map((m) => m.plot.data[2].filter((v) => v !== null).length)");
        assert!(drawn.as_array().unwrap().iter().all(|n| n.as_u64().unwrap() > 10), "{drawn}");
        for (theme, width) in [("light", 1280), ("dark", 390)] {
            page.show_as(theme, width);
            let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
            assert!(wide <= width, "{theme} at {width} px: the page is {wide} px wide");
            page.picture(&format!("{}/target/console-two-{theme}-{width}.png", env!("CARGO_MANIFEST_DIR")));
        }
        // Back to the first: its lease is still ours.
        page.eval("$('thruster').value = 't1'; $('thruster').dispatchEvent(new Event('change'))");
        page.until("thruster === 't1' && state !== null && state.id === 't1'");
        page.until(&text_is("lease-text", "You have the lease"));
        page.click("stop");
        page.until(&text_is("stop-text", "Stopped: confirmed"));
        for id in ["t1", "t2"] {
            wait("both to be disarmed", || {
                (stack.get(&format!("/v1/thrusters/{id}"))?["armed"] == false).then_some(())
            });
        }
        page.until("[...document.querySelectorAll('#mates .armed')].every((chip) => chip.textContent === 'disarmed')");
        // What was stopped is not said any more once it is armed again.
        page.click("arm");
        page.until("state.armed");
        page.until("$('stop-text').textContent === ''");
        assert_eq!(page.errors, Vec::<String>::new());
    });
}
