//! A headless Chromium that is told what to do by the Chrome DevTools protocol.

use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

/// Machines of continuous integration may be slow to start a browser.
const PATIENCE: Duration = Duration::from_secs(90);

/// A browser with one page; closed when dropped.
pub struct Browser {
    process: Process,
    socket: WebSocket<TcpStream>,
    session: String,
    last_id: u64,
    /// What the page has reported so far.
    events: Vec<Value>,
    _profile: TempDir,
}

/// A program that does not outlive the test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill(); // which has no effect on what has ended
        let _ = self.0.wait();
    }
}

/// The browser's program: the one that `RELT_CHROMIUM` names, or the first that is in the path.
pub fn find() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("RELT_CHROMIUM") {
        return Some(named.into());
    }
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

impl Browser {
    /// Starts `program` with a profile of its own.
    pub fn start(program: &Path) -> Browser {
        let profile = tempfile::tempdir().unwrap();
        let process = Command::new(program)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--disable-dev-shm-usage", "--hide-scrollbars", "--force-color-profile=srgb"])
            .args(["--remote-debugging-port=0", "about:blank"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start {}: {error}", program.display()));
        let mut process = Process(process);
        let (port, path) = address(&mut process.0, &profile.path().join("DevToolsActivePort"));
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(format!("ws://127.0.0.1:{port}{path}"), stream).unwrap();
        let (session, events) = (String::new(), Vec::new());
        let mut browser = Browser { process, socket, session, last_id: 0, events, _profile: profile };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attached = json!({"targetId": target["targetId"], "flatten": true});
        browser.session = browser.call("Target.attachToTarget", attached)["sessionId"].as_str().unwrap().into();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Asks for something and waits for the answer.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let mut request = json!({"id": self.last_id, "method": method, "params": parameters});
        if !self.session.is_empty() {
            request["sessionId"] = self.session.clone().into();
        }
        self.socket.send(Message::text(request.to_string())).unwrap();
        loop {
            let mut message = self.receive();
            if message["id"] == self.last_id {
                assert!(message.get("error").is_none(), "{method}: {}", message["error"]);
                return message["result"].take();
            }
            self.events.push(message);
        }
    }

    fn receive(&mut self) -> Value {
        loop {
            match self.socket.read().expect("the browser answers within the time that a test takes") {
                Message::Text(text) => return serde_json::from_str(&text).unwrap(),
                Message::Close(_) => panic!("the browser went away"),
                _ => {}
            }
        }
    }

    /// Opens a file in a window of that width and waits until it is loaded.
    pub fn open(&mut self, path: &Path, [width, height]: [u32; 2]) {
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", size);
        self.events.clear();
        self.call("Page.navigate", json!({"url": format!("file://{}", path.display())}));
        while !self.events.iter().any(|event| event["method"] == "Page.loadEventFired") {
            let event = self.receive();
            self.events.push(event);
        }
    }

    /// Value of an expression in the page.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let request = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", request);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].take()
    }

    /// What consoles, exceptions and policies have said since the page was opened, and all that was asked of a network.
    pub fn complaints(&mut self) -> Vec<String> {
        self.evaluate("0"); // all events of before have arrived by its answer
        let bad = |event: &&Value| match event["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded" => true,
            "Network.requestWillBeSent" => {
                let url = event["params"]["request"]["url"].as_str().unwrap_or_default();
                !url.starts_with("file:") && !url.starts_with("data:")
            }
            _ => false,
        };
        self.events.iter().filter(bad).map(Value::to_string).collect()
    }

    /// Picture of a part of the page, given by a selector, or of all of it.
    pub fn picture(&mut self, selector: Option<&str>) -> Picture {
        let mut request = json!({"format": "png", "captureBeyondViewport": true});
        let selector = selector.unwrap_or("html");
        let [x, y, width, height] = self.place(selector);
        request["clip"] = json!({"x": x, "y": y, "width": width, "height": height, "scale": 1});
        let answer = self.call("Page.captureScreenshot", request);
        Picture::of(BASE64_STANDARD.decode(answer["data"].as_str().unwrap()).unwrap())
    }

    /// Left, top, width and height of an element on the page.
    pub fn place(&mut self, selector: &str) -> [f64; 4] {
        let script = format!(
            "(() => {{ const box = document.querySelector({selector:?}).getBoundingClientRect(); \
             return [box.left + scrollX, box.top + scrollY, box.width, box.height]; }})()"
        );
        serde_json::from_value(self.evaluate(&script)).unwrap_or_else(|error| panic!("{selector}: {error}"))
    }

    /// Presses the left button at the first place of the window, moves to the last, and lets go.
    pub fn drag(&mut self, places: &[[f64; 2]]) {
        let mut mouse = |kind: &str, [x, y]: [f64; 2]| {
            let buttons = u8::from(kind != "mouseReleased");
            let event = json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1});
            self.call("Input.dispatchMouseEvent", event);
        };
        mouse("mousePressed", places[0]);
        places[1..].iter().for_each(|place| mouse("mouseMoved", *place));
        mouse("mouseReleased", places[places.len() - 1]);
    }

    /// Presses a key and lets go.
    pub fn press(&mut self, key: &str, code: u32) {
        for kind in ["rawKeyDown", "keyUp"] {
            let event = json!({"type": kind, "key": key, "windowsVirtualKeyCode": code});
            self.call("Input.dispatchKeyEvent", event);
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let close = json!({"id": 0, "method": "Browser.close"});
        let asked = self.socket.send(Message::text(close.to_string()));
        let start = Instant::now();
        while asked.is_ok() && start.elapsed() < Duration::from_secs(10) {
            if !matches!(self.process.0.try_wait(), Ok(None)) {
                return;
            }
            sleep(Duration::from_millis(20));
        }
    }
}

/// Port and path that the browser writes to a file once it listens.
fn address(process: &mut Child, file: &Path) -> (u16, String) {
    let start = Instant::now();
    loop {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        if let Some((port, path)) = text.trim_end().split_once('\n') {
            return (port.parse().unwrap(), path.to_owned());
        }
        let ended = process.try_wait().unwrap();
        assert!(ended.is_none() && start.elapsed() < PATIENCE, "the browser does not listen ({ended:?})");
        sleep(Duration::from_millis(20));
    }
}

/// What a browser shows.
pub struct Picture {
    /// The PNG file.
    pub file: Vec<u8>,
    /// Three bytes a pixel.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn of(file: Vec<u8>) -> Picture {
        let mut reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        let channels = info.color_type.samples();
        let pixels = bytes[..info.buffer_size()].chunks_exact(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        let pixels = pixels.collect();
        Picture { file, pixels }
    }

    /// How many pixels have about that colour, `#rrggbb`.
    pub fn count(&self, colour: &str) -> usize {
        let wanted: [u8; 3] = [1, 3, 5].map(|i| u8::from_str_radix(&colour[i..i + 2], 16).unwrap());
        let near = |pixel: &&[u8; 3]| pixel.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 3);
        self.pixels.iter().filter(near).count()
    }
}
