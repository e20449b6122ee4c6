//! A real browser, spoken to over the DevTools protocol, so that no driver is needed.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{self, Message, WebSocket, stream::MaybeTlsStream};

use crate::common::{PATIENCE, in_real_time, wait};

/// Browsers that draw at a time: of more than two each is late on two cores.
static FREE: (Mutex<usize>, Condvar) = (Mutex::new(2), Condvar::new());

/// Runs a test of a page in real time, service and all, in its turn.
pub fn in_its_turn(test: impl Fn()) {
    struct Turn;
    impl Drop for Turn {
        fn drop(&mut self) {
            *FREE.0.lock().unwrap() += 1;
            FREE.1.notify_one();
        }
    }
    *FREE.1.wait_while(FREE.0.lock().unwrap(), |free| *free == 0).unwrap() -= 1;
    let _turn = Turn;
    in_real_time(test);
}

/// A headless browser with one page.
pub struct Browser {
    process: Child,
    _profile: tempfile::TempDir,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    next: u64,
    /// Addresses the page asked for.
    pub asked: Vec<String>,
    /// Errors the page raised.
    pub errors: Vec<String>,
}

impl Browser {
    /// Opens a page; `None`, said aloud, if no browser is installed.
    pub fn open(url: &str) -> Option<Browser> {
        let profile = tempfile::tempdir().unwrap();
        let started = ["chromium", "chromium-browser", "google-chrome"].iter().find_map(|program| {
            Command::new(program)
                .args([
                    "--headless=new",
                    "--no-sandbox",
                    "--disable-gpu",
                    "--disable-dev-shm-usage",
                    "--no-first-run",
                ])
                .args(["--remote-debugging-port=0", "--window-size=1400,1150"])
                .arg(format!("--user-data-dir={}", profile.path().display()))
                .arg("about:blank")
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .ok()
        });
        let Some(mut process) = started else {
            println!("not run: chromium is not installed");
            return None;
        };
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let devtools = lines
            .find_map(|line| line.ok()?.strip_prefix("DevTools listening on ").map(str::to_owned))
            .expect("the browser names its DevTools address");
        std::thread::spawn(move || lines.for_each(drop));
        let host = devtools.split('/').nth(2).unwrap().to_owned();
        let page = wait("the page's DevTools address", || {
            let list: Value =
                ureq::get(format!("http://{host}/json/list")).call().ok()?.body_mut().read_json().ok()?;
            list.as_array()?.iter().find(|target| target["type"] == "page")?["webSocketDebuggerUrl"]
                .as_str()
                .map(str::to_owned)
        });
        let (socket, _) = tungstenite::connect(page).unwrap();
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        }
        let mut browser =
            Browser { process, _profile: profile, socket, next: 0, asked: Vec::new(), errors: Vec::new() };
        for domain in ["Runtime.enable", "Network.enable", "Page.enable", "Log.enable"] {
            browser.call(domain, json!({}));
        }
        browser.call("Page.navigate", json!({ "url": url }));
        Some(browser)
    }

    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let request = json!({"id": self.next, "method": method, "params": params});
        self.socket.send(Message::text(request.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["id"] == self.next {
                return message["result"].clone();
            }
            let params = &message["params"];
            match message["method"].as_str() {
                Some("Network.requestWillBeSent") => {
                    self.asked.push(params["request"]["url"].as_str().unwrap().to_owned())
                }
                Some("Network.webSocketCreated") => {
                    self.asked.push(params["url"].as_str().unwrap().to_owned())
                }
                Some("Runtime.exceptionThrown") => self.errors.push(params["exceptionDetails"].to_string()),
                Some("Log.entryAdded") if params["entry"]["level"] == "error" => {
                    self.errors.push(params["entry"].to_string())
                }
                _ => (),
            }
        }
    }

    /// Value of a JavaScript expression.
    pub fn eval(&mut self, expression: &str) -> Value {
        let answer = self.call("Runtime.evaluate", json!({"expression": expression, "returnByValue": true}));
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true; fails with what the page has said until then.
    pub fn until(&mut self, expression: &str) {
        let end = Instant::now() + PATIENCE;
        while self.eval(expression) != json!(true) {
            if Instant::now() > end {
                let said = self.eval("document.getElementById('log')?.innerText ?? ''");
                panic!(
                    "waited in vain for: {expression}; the page says {said}; its errors: {:?}",
                    self.errors
                );
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Clicks a button that can be clicked.
    pub fn click(&mut self, id: &str) {
        self.until(&format!("!document.getElementById('{id}').disabled"));
        self.eval(&format!("document.getElementById('{id}').click()"));
    }

    /// A theme, and a width in pixels, tall enough for the whole page.
    pub fn show_as(&mut self, theme: &str, width: u64) {
        let features = json!([{"name": "prefers-color-scheme", "value": theme}]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
        let size = json!({"width": width, "height": 3200, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", size);
        std::thread::sleep(Duration::from_millis(400));
    }

    pub fn picture(&mut self, path: &str) {
        let answer = self.call("Page.captureScreenshot", json!({"format": "png"}));
        let encoded = answer["data"].as_str().unwrap();
        let out = Command::new("base64")
            .arg("-d")
            .stdin(Stdio::piped())
            .stdout(std::fs::File::create(path).unwrap())
            .spawn();
        let mut decoder = out.unwrap();
        std::io::Write::write_all(&mut decoder.stdin.take().unwrap(), encoded.as_bytes()).unwrap();
        assert!(decoder.wait().unwrap().success());
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
