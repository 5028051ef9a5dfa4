//! A headless Chromium, driven over its debugging pipe: does what a reader does, and records what the browser reports.
//! Each [`Browser`] has storage and settings of its own. The processes are kept: a start takes as long as a short test.
//!
//! Rule: the browser records every console message, exception, violation of the page's policy and request for anything
//! but the page itself. Each fails the test at [`Browser::close`].

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::need;

/// Longer than anything that a page does on one machine.
const PATIENCE: Duration = Duration::from_mins(2);

const FLAGS: [&str; 13] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--remote-debugging-pipe",
    "--window-size=1280,900",
];

/// A running Chromium. It ends when its pipe closes, at the latest with the tests.
struct Chromium {
    _process: Child,
    commands: ChildStdin,
    answers: Receiver<Value>,
    last_id: u64,
}

/// Processes without a page.
static IDLE: Mutex<Vec<Chromium>> = Mutex::new(Vec::new());

/// A browser with one page open.
pub struct Browser {
    /// `None` once it is given back.
    chromium: Option<Chromium>,
    /// The storage and the settings of this browser alone.
    context: String,
    session: Option<String>,
    faults: Vec<String>,
    loads: usize,
    page: String,
    home: TempDir,
}

impl Browser {
    /// Opens `html` from disk.
    pub fn open(html: &str) -> Self {
        Self::open_with(html, &[])
    }

    /// Opens `html` from disk after these commands.
    pub fn open_with(html: &str, before: &[(&str, Value)]) -> Self {
        Self::open_from_disk(html, "", before)
    }

    /// Opens `html` from disk with a query in its address.
    pub fn open_at(html: &str, query: &str) -> Self {
        Self::open_from_disk(html, query, &[])
    }

    fn open_from_disk(html: &str, query: &str, before: &[(&str, Value)]) -> Self {
        let mut browser = Self::start(&need::browser());
        let file = browser.home.path().join("report.html");
        std::fs::write(&file, html).unwrap();
        let page = format!("file://{}", file.display());
        browser.visit(&format!("{page}{query}"), &page, before);
        browser
    }

    /// Opens an address; other files in its folder belong to the page.
    #[cfg(feature = "view")]
    pub fn at(address: &str) -> Self {
        let mut browser = Self::start(&need::browser());
        let folder = address.split('?').next().unwrap().rsplit_once('/').unwrap().0.to_owned() + "/";
        browser.visit(address, &folder, &[]);
        browser
    }

    /// Goes to an address; requests for addresses that begin with `page` are allowed.
    fn visit(&mut self, address: &str, page: &str, before: &[(&str, Value)]) {
        let browser = self;
        page.clone_into(&mut browser.page);
        let target = json!({"url": "about:blank", "browserContextId": browser.context, "newWindow": true});
        let target = browser.send("Target.createTarget", &target);
        let attached = json!({"targetId": target["targetId"], "flatten": true});
        let session = browser.send("Target.attachToTarget", &attached)["sessionId"].as_str().unwrap().to_owned();
        browser.session = Some(session);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.send(&format!("{domain}.enable"), &json!({}));
        }
        for (method, parameters) in before {
            browser.send(method, parameters);
        }
        browser.send("Page.navigate", &json!({"url": address}));
        while browser.loads == 0 {
            browser.receive();
        }
    }

    fn start(program: &Path) -> Self {
        let idle = IDLE.lock().unwrap().pop();
        let chromium = Some(idle.unwrap_or_else(|| Chromium::start(program)));
        let (session, page, home) = (None, String::new(), tempfile::tempdir().unwrap());
        let context = String::new();
        let mut browser = Self { chromium, context, session, faults: Vec::new(), loads: 0, page, home };
        let context = browser.send("Target.createBrowserContext", &json!({}));
        context["browserContextId"].as_str().unwrap().clone_into(&mut browser.context);
        browser
    }

    /// Sends a command of the debugging protocol and returns its result.
    pub fn send(&mut self, method: &str, parameters: &Value) -> Value {
        let chromium = self.chromium.as_mut().unwrap();
        let id = chromium.send(method, parameters, self.session.as_deref());
        loop {
            let answer = self.receive();
            if answer["id"] == json!(id) {
                assert!(answer.get("error").is_none(), "{method}: {}", answer["error"]);
                if ["Emulation.setEmulatedMedia", "Emulation.setDeviceMetricsOverride"].contains(&method) {
                    self.settle();
                }
                return answer["result"].clone();
            }
        }
    }

    /// Waits for two frames and a task, so that the page has seen earlier commands: media change events and a new
    /// size arrive with a frame, not with the command.
    fn settle(&mut self) {
        let frame = "(done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 0, 0)))";
        self.value(&format!("new Promise({frame})"));
    }

    fn receive(&mut self) -> Value {
        let message = self.chromium.as_mut().unwrap().answers.recv_timeout(PATIENCE).expect("the browser answers");
        // What is late from the page of another browser.
        if message.get("sessionId").is_some() && message["sessionId"].as_str() != self.session.as_deref() {
            return message;
        }
        let parameters = &message["params"];
        match message["method"].as_str() {
            Some("Page.loadEventFired") => self.loads += 1,
            Some("Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded") => {
                self.faults.push(message.to_string());
            }
            Some("Network.requestWillBeSent") => {
                let url = parameters["request"]["url"].as_str().unwrap_or_default();
                if !url.starts_with(&self.page) && !url.starts_with("data:") {
                    self.faults.push(format!("a request for {url}"));
                }
            }
            _ => {}
        }
        message
    }

    /// The value of an expression in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let answer = self.send("Runtime.evaluate", &parameters);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// The value of an expression, as text.
    pub fn text(&mut self, expression: &str) -> String {
        let value = self.value(expression);
        value.as_str().unwrap_or_else(|| panic!("{expression} gave {value}")).to_owned()
    }

    /// The value of an expression, as a list of texts.
    pub fn texts(&mut self, expression: &str) -> Vec<String> {
        serde_json::from_value(self.value(expression)).unwrap()
    }

    /// Returns true if an expression is true in the page.
    pub fn holds(&mut self, expression: &str) -> bool {
        self.value(expression).as_bool().unwrap_or_else(|| panic!("{expression} is not a truth value"))
    }

    /// Moves the pointer over the first element that matches `selector`.
    pub fn point_at(&mut self, selector: &str) -> (f64, f64) {
        let place = format!(
            "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{block: 'center'}}); \
             const r = e.getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
        );
        let (x, y): (f64, f64) = serde_json::from_value(self.value(&place)).unwrap();
        self.mouse("mouseMoved", (x, y));
        (x, y)
    }

    /// Clicks on the first element that matches `selector`.
    pub fn click(&mut self, selector: &str) {
        let at = self.point_at(selector);
        self.mouse("mousePressed", at);
        self.mouse("mouseReleased", at);
    }

    fn mouse(&mut self, kind: &str, (x, y): (f64, f64)) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let event = json!({"type": kind, "x": x, "y": y, "button": button, "clickCount": 1});
        self.send("Input.dispatchMouseEvent", &event);
    }

    /// Presses and releases a key.
    pub fn press(&mut self, key: &str) {
        let (code, number, text) = match key {
            "Tab" => ("Tab", 9, ""),
            "Enter" => ("Enter", 13, "\r"),
            "Escape" => ("Escape", 27, ""),
            " " => ("Space", 32, " "),
            "ArrowLeft" => (key, 37, ""),
            "ArrowUp" => (key, 38, ""),
            "ArrowRight" => (key, 39, ""),
            "ArrowDown" => (key, 40, ""),
            "End" => (key, 35, ""),
            "Home" => (key, 36, ""),
            "/" => ("Slash", 191, "/"),
            "a" => ("KeyA", 65, "a"),
            "l" => ("KeyL", 76, "l"),
            other => panic!("no key {other}"),
        };
        let mut event = json!({"type": "keyDown", "key": key, "code": code, "windowsVirtualKeyCode": number});
        if !text.is_empty() {
            event["text"] = json!(text);
        }
        self.send("Input.dispatchKeyEvent", &event);
        event["type"] = json!("keyUp");
        self.send("Input.dispatchKeyEvent", &event);
    }

    /// The browser's complaints so far.
    pub fn complaints(&mut self) -> &[String] {
        self.settle();
        &self.faults
    }

    /// Ends the browser.
    ///
    /// # Panics
    /// If the browser had any complaint.
    pub fn close(mut self) {
        assert_eq!(self.complaints(), Vec::<String>::new());
    }
}

#[test]
fn errors_and_requests_of_a_page_are_noticed() {
    for (body, complaint) in [
        ("<script>console.error('a slip')</script>", "a slip"),
        ("<script>throw new Error('a slip')</script>", "a slip"),
        ("<script>Promise.reject(new Error('a slip'))</script>", "a slip"),
        ("<img src='https://mirror.invalid/a.png' alt=''>", "a request for https://mirror.invalid/a.png"),
        ("<link rel='stylesheet' href='other.css'>", "other.css"),
        (
            "<meta http-equiv='Content-Security-Policy' content=\"script-src 'none'\"><script>0</script>",
            "Content Security Policy",
        ),
    ] {
        let mut browser = Browser::open(&format!("<!doctype html><title>t</title>{body}"));
        let complaints = browser.complaints();
        assert!(complaints.iter().any(|found| found.contains(complaint)), "{body}: {complaints:?}");
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // A browser that a failed test leaves in an unknown state ends with it.
        let mut chromium = self.chromium.take().unwrap();
        if !thread::panicking() {
            chromium.send("Target.disposeBrowserContext", &json!({"browserContextId": self.context}), None);
            IDLE.lock().unwrap().push(chromium);
        }
    }
}

impl Chromium {
    /// Starts the browser. A shell sets up file descriptors 3 and 4 for the pipe.
    fn start(program: &Path) -> Self {
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(program)
            .args(FLAGS)
            .arg(format!("--user-data-dir={}", profile().display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (sender, answers) = channel();
        let mut pipe = BufReader::new(process.stdout.take().unwrap());
        thread::spawn(move || {
            loop {
                let mut message = Vec::new();
                match pipe.read_until(0, &mut message) {
                    Ok(1..) if message.pop() == Some(0) => {}
                    _ => return,
                }
                if sender.send(serde_json::from_slice(&message).unwrap()).is_err() {
                    return;
                }
            }
        });
        let commands = process.stdin.take().unwrap();
        Self { _process: process, commands, answers, last_id: 0 }
    }

    /// Sends a command; returns the number that its answer will have.
    fn send(&mut self, method: &str, parameters: &Value, session: Option<&str>) -> u64 {
        self.last_id += 1;
        let mut message = json!({"id": self.last_id, "method": method, "params": parameters});
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        let mut bytes = serde_json::to_vec(&message).unwrap();
        bytes.push(0);
        self.commands.write_all(&bytes).unwrap();
        self.last_id
    }
}

/// A new folder for the files of a browser. Those of earlier tests are removed: nothing does so when tests end.
fn profile() -> PathBuf {
    static STARTED: AtomicUsize = AtomicUsize::new(0);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("browsers");
    let number = STARTED.fetch_add(1, Ordering::Relaxed);
    if number == 0 {
        let earlier = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let ended = earlier.filter(|entry| {
            let name = entry.file_name();
            let process = name.to_str().and_then(|name| name.split('-').next());
            process.is_some_and(|process| !Path::new("/proc").join(process).exists())
        });
        ended.for_each(|entry| drop(std::fs::remove_dir_all(entry.path())));
    }
    folder.join(format!("{}-{number}", std::process::id()))
}
