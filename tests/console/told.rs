//! What the page says is so: of a signal that is not there, of path lights, of diagnoses, of a setpoint after a reload, of links.

use serde_json::{Value, json};

use crate::browser::{Browser, in_its_turn};
use crate::common::{self, Site, Stack, wait};
use crate::text_is;

#[test]
fn nothing_is_offered_or_shown_that_is_not_so() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.until(&text_is("link", "live"));
        page.until(&text_is("signal-text", "staircase: 14.0 s"));
        page.eval("lease_ttl_ms = 60000");
        page.click("take");
        page.until(&text_is("lease-text", "You have the lease"));
        page.click("arm");
        page.until("state.armed && !$('play').disabled");
        // A file that is not chosen yet, an experiment that nobody proposes, a signal that is refused: no course, no Play.
        let choose = |page: &mut Browser, kind: &str| {
            page.eval(&format!(
                "$('signal-kind').value = '{kind}'; $('signal-kind').dispatchEvent(new Event('change'))"
            ));
        };
        for (kind, words) in
            [("file", "Choose a scenario file"), ("experiment", "no diagnosis that proposes")]
        {
            choose(&mut page, "staircase");
            page.until(
                "!$('play').disabled && document.querySelectorAll('#signal-plot canvas').length === 1",
            );
            choose(&mut page, kind);
            page.until(&text_is("signal-text", words));
            page.until("$('play').disabled && document.querySelectorAll('#signal-plot canvas').length === 0");
        }

        // The same file, changed meanwhile, is taken anew; a field without a number is no zero.
        choose(&mut page, "file");
        for level in [20, 30] {
            let file = format!(
                "{{\"name\": \"mine\", \"command\": \"thrust_cmd_n\", \"segments\": [{{\"kind\": \"hold\", \"value\": {level}, \"duration_s\": 2}}]}}"
            );
            page.eval(&format!("(() => {{ const chosen = new DataTransfer(); chosen.items.add(new File([{file:?}], 'mine.json')); $('signal-file').files = chosen.files; $('signal-file').dispatchEvent(new Event('change')); }})()"));
            page.until(&text_is("signal-text", &format!("mine.json: mine: 2.0 s, up to {level}.0 N")));
            assert_eq!(page.eval("$('signal-file').files.length"), 0);
        }
        choose(&mut page, "staircase");
        page.eval("$('signal-levels').value = ''; preview()");
        page.until(&text_is("signal-text", "A field is empty"));
        choose(&mut page, "staircase");

        // A limit that was set stays, and only comes down to what is allowed.
        let limit = |page: &mut Browser, typed: &str| {
            page.eval(&format!(
                "$('signal-limit').value = '{typed}'; $('signal-limit').dispatchEvent(new Event('input'))"
            ));
        };
        limit(&mut page, "22.5");
        choose(&mut page, "sine");
        assert_eq!(page.eval("$('signal-limit').value"), json!("22.5"));
        limit(&mut page, "100000");
        choose(&mut page, "ramp");
        assert_eq!(page.eval("Number($('signal-limit').value) === limitsOf.thrust_n"), json!(true));
        limit(&mut page, "");
        choose(&mut page, "staircase");
        assert_eq!(page.eval("$('signal-limit').value"), json!("60"));

        // A chip that is orange has its words.
        let told = |page: &mut Browser, level: Value, alarm: Value, torque: f64| -> String {
            let mismatch = json!({"alarm": alarm, "since_s": 3.0, "agrees": torque.abs() <= 0.05,
                "residuals": [{"residual": "current", "share": 0.01}, {"residual": "torque", "share": torque}, {"residual": "flow", "share": null}],
                "paths": [{"path": "drive", "level": 0.0}, {"path": "shaft", "level": level}]});
            let chip = "$('paths').children[1].className";
            page.eval(&format!("(showPaths({mismatch}), [$('mismatch-text').textContent, $('agreement-text').textContent, {chip}].join(' '))"))
                .as_str()
                .unwrap()
                .to_owned()
        };
        let orange = told(&mut page, json!(0.72), Value::Null, 0.0);
        assert!(orange.contains("shaft path (70 %) may have changed") && orange.contains("warn"), "{orange}");
        let well = told(&mut page, json!(0.2), Value::Null, 0.04);
        assert!(
            well.contains("No path has changed") && well.contains("was within 5 %") && well.ends_with("good"),
            "{well}"
        );
        // What is off from the start is no change, and no agreement either.
        let ever = told(&mut page, json!(0.0), Value::Null, 0.12);
        assert!(
            ever.contains("No path has changed")
                && ever.contains("off its rig description: torque 12 % above."),
            "{ever}"
        );
        assert!(!ever.contains("good") && !ever.contains("agrees"), "{ever}");
        let off = told(&mut page, json!(1.2), json!("shaft"), -0.2);
        assert!(
            off.contains("The shaft path has changed since") && off.contains("torque 20 % below"),
            "{off}"
        );

        // A gateway that answers late: what is asked for twice meanwhile is asked once, and what is known is not shown twice.
        page.eval("(() => { window.asked = 0; window.now = fetch; window.fetch = (url, ...how) => { if (!String(url).startsWith('/v1/events')) return now(url, ...how); asked += 1; return new Promise((on) => setTimeout(on, 2500)).then(() => now(url, ...how)); }; })()");
        let anew =
            "await eventsComing?.catch(() => {}); asked = 0; lastEvent = 0; $('events').replaceChildren()";
        page.eval(&format!("(async () => {{ {anew}; await Promise.all([loadEvents(), loadEvents()]); window.first = [asked, $('events').children.length]; }})(); 0"));
        page.until("window.first !== undefined");
        let events = stack.get("/v1/events?limit=100").unwrap().as_array().unwrap().len();
        assert_eq!(page.eval("first"), json!([1, events]));
        page.eval(&format!("(async () => {{ {anew}; await Promise.all([newEvents(), newEvents()]); window.second = $('events').children.length; }})(); 0"));
        page.until("window.second !== undefined");
        assert_eq!(page.eval("(window.fetch = now, second)"), json!(events));

        // A diagnosis that was cancelled takes nothing away from the one before.
        let list = json!([
            {"id": "d1", "state": "done", "summary": "Rotational flow is missing.", "findings": [], "usable": false, "rig_revision": 1},
            {"id": "d2", "state": "cancelled", "cause": null, "findings": []},
        ]);
        page.eval(&format!("(() => {{ const real = call; call = (method, path, ...rest) => path === diagnosesOf() ? Promise.resolve({list}) : path.endsWith('/d1') ? Promise.resolve({{ report: null }}) : real(method, path, ...rest); loadDiagnosis(); }})()"));
        page.until(&text_is("diagnosis-text", "Rotational flow is missing."));
        page.until(&text_is("diagnosis-text", "d2: cancelled"));
        assert_eq!(page.eval("found.id"), "d1");
        page.until("document.querySelector('#report a').textContent === 'report of d1'");
        // Sizes stand beside the names, and earlier diagnoses can be opened again.
        let found = json!({"findings": [{"effect": "coulomb_friction",
            "parameters": [{"name": "coulomb_torque_n_m", "value": 0.8139, "unit": "N m", "std_error": 0.0263}]}]});
        let sizes =
            page.eval(&format!("sizesOf({found}, 'coulomb_friction').join('').replaceAll('\\u00a0', ' ')"));
        assert_eq!(sizes, json!("coulomb torque 0.814 ± 0.026 N m"));
        assert_eq!(page.eval("$('earlier-list').rows.length"), json!(2), "d2 and d1 are listed");
        // On a phone its words have the page's width.
        let statement = "The wake turns with the propeller: the blades meet less than the shaft's own speed, and lose lift with it.";
        page.eval(&format!("$('findings').replaceChildren(cells(['rotational flow', 'blade', '0.97', '85 %', {statement:?}]))"));
        page.show_as("light", 390);
        let wide =
            page.eval("document.querySelector('#findings td:last-child').clientWidth").as_u64().unwrap();
        assert!(wide > 280, "{wide} px");
        page.picture(concat!(env!("CARGO_MANIFEST_DIR"), "/target/console-findings-390.png"));

        page.eval("$('entry').value = 60");
        page.click("send");
        page.until("state.setpoint.thrust_n === 60");
        page.call("Page.reload", json!({}));
        page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null && limitsOf !== null");
        page.until("Number($('entry').value) === 60 && Number($('slider').value) === 60");
        assert_eq!(page.errors, Vec::<String>::new());
    });
}

/// Where tokens are asked for no link opens a refusal: what is behind it is fetched with the token, and opened.
#[test]
fn links_carry_the_token() {
    in_its_turn(|| {
        let site = Site::new();
        site.add("[gateway]", "require_tokens = true");
        let mut command = std::process::Command::new(common::KORT);
        command.args(["token", "new", "bridge", "--role", "viewer", "--config"]).arg(site.config());
        let made = common::run(command.current_dir(site.folder.path()));
        let token = String::from_utf8(made.stdout).unwrap().trim().to_owned();
        let mut supervisor = site.spawn("up");
        let home = format!("http://127.0.0.1:{}", site.port);
        wait("the gateway", || {
            let asked =
                ureq::get(format!("{home}/readyz")).header("Authorization", format!("Bearer {token}")).call();
            asked.is_ok().then_some(())
        });
        if let Some(mut page) = Browser::open(&format!("{home}/")) {
            page.until("document.readyState === 'complete' && !document.getElementById('login').hidden");
            page.eval(&format!("$('token').value = {token:?}; $('login').requestSubmit()"));
            page.until(
                "document.readyState === 'complete' && typeof state !== 'undefined' && state !== null",
            );
            page.eval("window.opened = []; window.open = (address) => opened.push(address); URL.createObjectURL = (blob) => { blob.text().then((text) => { window.got = text; }); return 'blob:'; }");
            for (link, words) in [
                ("$('metrics')", "kort_"),
                (
                    "(document.body.append(faultItem({ code: 4, name: 'command_timeout', help: '' })), document.querySelector('body > li a'))",
                    "command",
                ),
            ] {
                page.eval(&format!("window.got = ''; {link}.click(); 0"));
                page.until(&format!("window.got.includes({words:?})"));
                assert_eq!(page.eval("window.got.includes('token-required')"), json!(false));
            }
            assert_eq!(page.eval("opened.length"), json!(2));
        }
        common::kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    });
}

/// What is old is not shown as now, nothing is commanded by it, and a stop that nobody confirms says so.
#[test]
fn a_frozen_gateway_is_seen_within_a_second() {
    in_its_turn(|| {
        let mut stack = Stack::start();
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined'");
        page.until(&text_is("link", "live"));
        stack.thrust(40.0, 60_000);
        page.until("state.armed");
        let gateway = stack.process_of("gateway");
        common::kill(gateway, "STOP");
        page.until("document.body.classList.contains('stale')");
        page.until(&text_is("link", "s old"));
        assert_eq!(page.eval("document.getElementById('send').disabled"), json!(true));
        assert_eq!(page.eval("document.getElementById('stop').disabled"), json!(false));
        page.eval("document.getElementById('stop').click()");
        page.until(&text_is("stop-text", "NOT CONFIRMED"));
        // The supervisor puts another gateway in the place of the one that hangs. What that one shows ends the alarm, and
        // nothing older does.
        page.until("!document.body.classList.contains('stale') && !state.armed");
        page.until(&text_is("stop-text", "Disarmed: the live state says so"));
        assert_eq!(page.eval("document.getElementById('stop-text').className"), json!("good"));
    });
}
