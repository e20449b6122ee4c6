//! What is not text: edges of what one fills in and presses, and what is disabled, in both themes.

use serde_json::json;

use crate::browser::{Browser, in_its_turn};
use crate::common::Stack;
use crate::text_is;

/// Fields and buttons whose edge, or own ground, is below 3:1 against what they stand on (WCAG 2.2, 1.4.11), and disabled
/// ones whose words are: nothing asks that of these, but who reads them knows what there would be.
const FAINT: &str = r##"(() => {
  const parse = (c) => { const n = c.match(/[\d.]+/g).map(Number); return [n[0], n[1], n[2], n[3] ?? 1]; };
  const over = (a, b, part = 1) => [0, 1, 2].map((i) => a[i] * a[3] * part + b[i] * (1 - a[3] * part)).concat(1);
  const light = (c) => { const [r, g, b] = c.map((x) => { x /= 255; return x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4; }); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const ratio = (p, q) => { const [a, b] = [light(p), light(q)].sort((x, y) => y - x); return (a + 0.05) / (b + 0.05); };
  const ground = (e) => { const up = []; for (let at = e; at; at = at.parentElement) up.unshift(parse(getComputedStyle(at).backgroundColor)); return up.reduce((under, c) => over(c, under), [255, 255, 255, 1]); };
  let seen = 0; const faint = [];
  for (const e of document.querySelectorAll('button, select, input:not([type=range], [type=radio], [type=checkbox])')) {
    if (!e.checkVisibility()) continue;
    seen += 1;
    const style = getComputedStyle(e), on = ground(e.parentElement), part = Number(style.opacity);
    const fill = over(parse(style.backgroundColor), on, part), ink = over(parse(style.color), fill, part);
    const r = e.disabled ? ratio(ink, fill) : Math.max(ratio(over(parse(style.borderTopColor), on), on), ratio(fill, on));
    if (r < 3) faint.push(`${e.tagName} ${e.id} ${e.textContent.trim().slice(0, 20)}${e.disabled ? ' disabled' : ''}: ${r.toFixed(2)}`);
  }
  return { seen, faint };
})()"##;

#[test]
fn what_is_filled_in_or_pressed_is_seen_in_both_themes() {
    in_its_turn(|| {
        let stack = Stack::start();
        let Some(mut page) = Browser::open(&format!("http://127.0.0.1:{}/", stack.site.port)) else { return };
        page.until("document.readyState === 'complete' && typeof state !== 'undefined'");
        page.until(&text_is("link", "live"));
        for theme in ["light", "dark"] {
            page.show_as(theme, 1280);
            let judged = page.eval(FAINT);
            assert!(judged["seen"].as_u64().unwrap() > 25, "{theme}: {judged}");
            assert_eq!(judged["faint"], json!([]), "{theme}");
        }
    });
}
