//! The plots: by keyboard, of two runs of unequal length, as a table and a picture, and every signal that the stream holds.

use serde_json::{Value, json};

use crate::browser::{Browser, in_its_turn};
use crate::common::Stack;
use crate::text_is;

/// Opened, and live.
fn open(stack: &Stack) -> Option<Browser> {
    let mut page = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port))?;
    page.until("document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
    page.until(&text_is("link", "live"));
    page.until("charts[0].plot !== null && charts[0].plot !== undefined && live.t.length > 50");
    Some(page)
}

fn press(page: &mut Browser, key: &str) {
    for kind in ["keyDown", "keyUp"] {
        page.call("Input.dispatchKeyEvent", json!({"type": kind, "key": key}));
    }
}

/// Two runs as a recording gives them: A of 7.1 s, B of 13 s, 20 N more.
const RUNS: &str = "(() => {
  const made = (end_s, step_s, more) => { const c = new Columns(); for (let t = 0; t <= end_s + 1e-9; t += step_s) c.push(t, { thrust_n: more + t, thrust_cmd_n: more, shaft_speed_rad_s: 10 * more, estimated_flow_low: more }); c.done = true; return c; };
  showRun({ a: made(7.1, 0.05, 10), b: made(13, 0.04, 30), names: ['first', 'second'], at_s: null, playing: null, difference: false });
})()";

fn table(page: &mut Browser) -> (Vec<String>, Vec<Vec<Option<f64>>>) {
    let text = page.eval("tableOf(...shownNow())").as_str().unwrap().to_owned();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    (head, lines.map(|cells| cells.iter().map(|cell| cell.parse().ok()).collect()).collect())
}

#[test]
fn plots_go_by_keyboard_to_the_end_of_both_runs_and_are_saved_whole() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = open(&stack) else { return };
        let reached = page.eval("[...document.querySelectorAll('.plots [tabindex=\"0\"]')].filter((e) => e.checkVisibility() && e.ariaLabel.includes('arrows')).length");
        assert_eq!(reached, json!(4), "every chart that is shown takes the keyboard, and says what it does");
        page.eval("charts[0].figure.focus()");
        press(&mut page, "ArrowLeft");
        press(&mut page, "ArrowLeft");
        page.until(
            "charts[1].plot.cursor.left > 0 && charts[1].plot.cursor.left < charts[1].plot.over.clientWidth",
        );
        page.until("/^[0-9.]+ s: commanded .*measured .* N$/.test($('cursor-text').textContent)");
        let span = "zoomed === null ? null : zoomed[1] - zoomed[0]";
        press(&mut page, "+");
        assert!((page.eval(span).as_f64().unwrap() - 15.0).abs() < 1e-6, "half of 30 s");
        press(&mut page, "-");
        assert_eq!(page.eval(span), Value::Null, "the whole window again");
        press(&mut page, "+");
        press(&mut page, "Home");
        assert_eq!(page.eval(span), Value::Null);

        moved_by_keyboard_and_mouse(&mut page);
        page.eval("zoomTo(null, null)");

        page.eval(RUNS);
        page.until("charts[0].shown.endsWith('true|false') && charts[0].plot.data[0].at(-1) > 12.9");
        let b = "charts[0].plot.data[1 + charts[0].signals.length + charts[0].signals.findIndex((s) => s[0] === 'thrust_n')]";
        assert!(page.eval(&format!("{b}.at(-1)")).as_f64().unwrap() > 42.0, "B goes on behind the end of A");
        let (head, rows) = table(&mut page);
        let at = |name: &str| head.iter().position(|one| one == name).unwrap_or_else(|| panic!("{head:?}"));
        assert!(!head.iter().any(|name| name.starts_with("difference_")));
        let last = rows.last().unwrap();
        assert!(last[0].unwrap() > 12.9 && last[at("thrust_n")].is_none(), "{last:?}");
        assert!(last[at("b_thrust_n")].unwrap() > 42.0, "{last:?}");
        page.eval("$('difference').click()");
        page.until("charts[0].shown.endsWith('true|true')");
        let (head, rows) = table(&mut page);
        let at = head.iter().position(|name| name == "difference_thrust_n").unwrap();
        let less: Vec<f64> = rows.iter().filter_map(|row| row[at]).collect();
        assert!(
            less.len() > 200 && less.iter().all(|newton| (newton - 20.0).abs() < 1e-9),
            "B is 20 N above A"
        );

        let sides = "['estimated_flow_low', 'estimated_flow_high'].map((name) => [run.lines.b.of(name).some((v) => v !== null), run.lines.less.of(name).some((v) => v !== null)])";
        assert_eq!(
            page.eval(sides)[0],
            json!([true, false]),
            "of the sides of a doubt there is no difference"
        );
        assert!(!head.iter().any(|name| name == "difference_estimated_flow_low"), "{head:?}");

        // In a picture as narrow as a phone every word of the legend stands within it.
        page.eval("SIGNALS.filter((s) => s[1] === 'N' || s[1] === 'm/s').forEach(([name]) => shownSignals.add(name))");
        page.show_as("light", 390);
        let outside = "(() => { const pen = document.createElement('canvas').getContext('2d'); pen.font = '13px system-ui, sans-serif'; \
            const words = charts.find((c) => c.unit === 'm/s').signals.map(([, , label]) => [label, '--ink']), placed = inLines(pen, words, 350, 6, 12); \
            return [placed.at(-1)[3], placed.filter(([said, , left]) => left + pen.measureText(said).width > 344).length]; })()";
        let told = page.eval(outside);
        assert!(told[0].as_u64().unwrap() >= 1 && told[1] == json!(0), "lines, and words outside: {told}");
        page.eval("pictureOf(shownNow()[0]).then((blob) => { const r = new FileReader(); r.onload = () => { window.pictured = r.result; }; r.readAsDataURL(blob); }); 0");
        page.until("window.pictured !== undefined");
        page.eval("(() => { const saved = new Image(); saved.src = window.pictured; document.body.prepend(saved); })()");
        page.picture(concat!(env!("CARGO_MANIFEST_DIR"), "/target/console-saved-390.png"));
        assert_eq!(page.errors, Vec::<String>::new());
    });
}

/// Zoom is asked for quicker than pictures come, and the window moves: by Shift with arrows, a drag or the wheel.
fn moved_by_keyboard_and_mouse(page: &mut Browser) {
    let window = |page: &mut Browser| -> [f64; 2] {
        let told = page.eval("shownNow().slice(1)");
        [told[0].as_f64().unwrap(), told[1].as_f64().unwrap()]
    };
    // Four keys between two pictures.
    page.eval("['+', '+', '+', '-'].forEach((key) => charts[0].figure.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true })))");
    let [from, to] = window(page);
    assert!((to - from - 7.5).abs() < 1e-6, "half, half, half and twice 30 s: {}", to - from);
    page.eval("charts[0].figure.focus()");
    for kind in ["keyDown", "keyUp"] {
        page.call("Input.dispatchKeyEvent", json!({"type": kind, "key": "ArrowLeft", "modifiers": 8}));
    }
    let [moved, end] = window(page);
    assert!(
        (from - moved - 0.75).abs() < 1e-6 && (end - moved - 7.5).abs() < 1e-6,
        "a tenth back: {moved}, {end}"
    );
    page.eval("charts[0].figure.scrollIntoView({ block: 'center' })");
    let at = page.eval("(() => { const r = charts[0].plot.over.getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2, r.width]; })()");
    let [x, y, width] = [0, 1, 2].map(|k| at[k].as_f64().unwrap());
    let [before, _] = window(page);
    let mouse = |page: &mut Browser, kind: &str, x: f64, more: Value| {
        let mut event = json!({"type": kind, "x": x, "y": y, "button": "left", "modifiers": 8});
        event.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        page.call("Input.dispatchMouseEvent", event);
    };
    mouse(page, "mousePressed", x, json!({"clickCount": 1}));
    mouse(page, "mouseMoved", x + 0.2 * width, json!({"buttons": 1}));
    mouse(page, "mouseReleased", x + 0.2 * width, json!({"clickCount": 1}));
    page.until(&format!("Math.abs(shownNow()[1] - {before} + 1.5) < 0.1"));
    let [from, to] = window(page);
    assert!((to - from - 7.5).abs() < 1e-6, "a drag with Shift is no zoom");
    mouse(page, "mouseWheel", x, json!({"deltaX": 0, "deltaY": 0.1 * width}));
    page.until(&format!("Math.abs(shownNow()[1] - {from} - 0.75) < 0.05"));
    mouse(page, "mouseWheel", x, json!({"deltaX": 0, "deltaY": -100, "modifiers": 2}));
    page.until("Math.abs(shownNow()[2] - shownNow()[1] - 6) < 1e-6");
    // Not beyond what there is.
    page.eval("for (let k = 0; k < 2000; k += 1) panBy(-0.5)");
    let over = page.eval("live.t[0] - shownNow()[1]").as_f64().unwrap();
    let whole = page.eval("wholeNow()[1] - shownNow()[1]").as_f64().unwrap();
    assert!(over.abs() < 0.1 || whole.abs() < 1.0, "{over} {whole}");
}

#[test]
fn every_signal_of_the_stream_can_be_plotted() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = open(&stack) else { return };
        page.until("state.estimated.parameters.length > 0 && state.mismatch !== null");
        let missing = page.eval(
            "[...state.estimated.parameters.map((p) => `estimated_${p.name}`), ...state.mismatch.paths.map((p) => `mismatch_${p.path}`)]\
             .filter((name) => !$(`show-${name}`) && !(name.slice(10) in state.estimated))",
        );
        assert_eq!(missing, json!([]));
        let name = page.eval(
            "state.estimated.parameters.find((p) => !(p.name in state.estimated) && p.value !== null).name",
        );
        let name = name.as_str().unwrap();
        page.eval(&format!("$('show-estimated_{name}').click(); $('show-mismatch_shaft').click()"));
        let chart = "charts.find((c) => c.signals.some((s) => s[0] === SHOWN))";
        for (shown, of) in [
            (format!("estimated_{name}"), "state.estimated.parameters"),
            ("mismatch_shaft".into(), "state.mismatch.paths"),
        ] {
            let chart = chart.replace("SHOWN", &format!("'{shown}'"));
            page.until(&format!(
                "{chart}.plot !== undefined && !{chart}.figure.hidden && {chart}.figure.isConnected"
            ));
            let line = format!("{chart}.plot.data[1 + {chart}.signals.findIndex((s) => s[0] === '{shown}')]");
            page.until(&format!("{line}.length === {chart}.plot.data[0].length && ({of}.every((p) => (p.value ?? p.level) === null) || {line}.some((v) => v !== null))"));
        }
        for (theme, width) in [("light", 1280), ("dark", 390)] {
            page.show_as(theme, width);
            page.picture(&format!(
                "{}/target/console-signals-{theme}-{width}.png",
                env!("CARGO_MANIFEST_DIR")
            ));
        }
        assert_eq!(page.errors, Vec::<String>::new());
    });
}

/// What observer and estimator said before the page was opened, and while a recording was made, is in the plots as what they say now.
#[test]
fn estimates_are_shown_of_the_minutes_before_and_of_recordings() {
    in_its_turn(|| {
        let mut stack = Stack::start();
        let Some(mut page) = open(&stack) else { return };
        page.eval("call('POST', '/v1/recordings', { name: 'held' }).then(() => { window.begun = true; }); 0");
        page.until("window.begun");
        stack.thrust(40.0, 30_000);
        std::thread::sleep(std::time::Duration::from_secs(4));
        page.eval("call('DELETE', '/v1/recordings/held').then(() => { window.ended = true; }); 0");
        page.until("window.ended");
        // Opened anew: nothing of it has come by the stream.
        page.eval("window.old = true; location.reload()");
        page.until("window.old === undefined && document.readyState === 'complete' && typeof state !== 'undefined' && state !== null");
        page.until("live.t.at(-1) - live.t[0] > 3 && live.t.length > 120");
        // Every estimate that the stream has a value of, and its doubt, has one in each second before the first state that came.
        let told = "[...state.estimated.parameters.filter((p) => p.value !== null).map((p) => `estimated_${p.name}`), 'estimated_flow_low', 'estimated_flow_high']";
        let holes = |of: &str| {
            format!(
                "{told}.filter((name) => [0, 1, 2].some((s) => !{of}.t.some((t, i) => t >= {of}.t[0] + 0.5 + s && t < {of}.t[0] + 1.5 + s && {of}.of(name)[i] !== null)))"
            )
        };
        assert!(page.eval(&format!("{told}.length")).as_u64().unwrap() > 6);
        assert_eq!(page.eval(&holes("live")), json!([]), "the minutes before");
        page.until(
            "[...document.querySelectorAll('#recordings button')].some((b) => b.ariaLabel === 'show held')",
        );
        page.eval("[...document.querySelectorAll('#recordings button')].find((b) => b.ariaLabel === 'show held').click()");
        page.until("run !== null && run.a.t.length > 100");
        assert_eq!(page.eval(&holes("run.a")), json!([]), "the recording");
        // As it was: near the sensor, at the same instants.
        let apart = "Math.max(...run.a.t.map((t, i) => [t, run.a.of('estimated_thrust_n')[i], run.a.of('thrust_n')[i]]).filter(([t, a, b]) => t > 2 && a !== null && b !== null).map(([, a, b]) => Math.abs(a - b)))";
        let newton = page.eval(apart).as_f64().unwrap();
        assert!(newton < 12.0, "{newton}");
        page.eval("[...document.querySelectorAll('details summary')].find((s) => s.textContent === 'keys and mouse').click()");
        for (theme, width) in [("light", 1280), ("dark", 1280), ("light", 390), ("dark", 390)] {
            page.show_as(theme, width);
            let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
            assert!(wide <= width, "{theme} at {width} px: the page is {wide} px wide");
            page.picture(&format!(
                "{}/target/console-estimates-{theme}-{width}.png",
                env!("CARGO_MANIFEST_DIR")
            ));
        }
        assert_eq!(page.errors, Vec::<String>::new());
    });
}

/// What is commanded is within its slew, live as in recordings; disarmed it is nothing.
#[test]
fn the_command_in_the_plots_is_the_one_in_force() {
    in_its_turn(|| {
        let mut stack = Stack::start();
        let Some(mut page) = open(&stack) else { return };
        for newton in [100.0, -100.0] {
            stack.thrust(newton, 60_000);
            page.until(&format!("live.of('thrust_cmd_n').at(-1) === {newton}"));
        }
        let between = page
            .eval("live.of('thrust_cmd_n').filter((v) => v !== null && v > -99 && v < 99 && v !== 0).length");
        assert!(between.as_u64().unwrap() > 2, "{between}");
        page.click("stop");
        page.until("!state.armed && live.of('thrust_cmd_n').at(-1) === null");
        assert_eq!(page.errors, Vec::<String>::new());
    });
}
