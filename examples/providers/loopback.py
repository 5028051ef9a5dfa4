"""What the servers of this folder share: HTTP on loopback, and a model that turns left until its fourth step."""

import argparse
import json
import re
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

count = {"requests": 0, "paid": 0}
lock = threading.Lock()


def reply(text):
    """The reply as JSON: it counts its steps in its summary, which comes back with the next request."""
    counted = re.search(r"counted to (\d+)", text)
    step = int(counted.group(1)) + 1 if counted else 1
    said = {
        "view-description": "a wall", "reasoning": "none", "action": "a" if step < 4 else "done",
        "summary": f"counted to {step} steps", "selected_cube": "none", "identification": "I am red",
    }
    # Some experiments ask for no cube.
    return json.dumps({key: value for key, value in said.items() if key in text})


def serve(answer):
    """Serves `answer(at, path, headers, body, text)`: the number of the request from 1, and what it says; it gives the status,
    headers and the body. A GET says how many requests came and how many were paid."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--latency", type=float, default=0.0, help="seconds for an answer")
    typed = parser.parse_args()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self):
            text = self.rfile.read(int(self.headers["content-length"])).decode()
            with lock:
                count["requests"] += 1
                at = count["requests"]
            time.sleep(typed.latency)
            status, headers, body = answer(at, self.path, self.headers, json.loads(text), text)
            data = (body if isinstance(body, str) else json.dumps(body)).encode()
            with lock:
                count["paid"] += status == 200 and b'"usage' in data
            self.say(status, headers, data)

        def do_GET(self):
            self.say(200, {}, json.dumps(count).encode())

        def say(self, status, headers, data):
            self.send_response(status)
            for name, value in {**headers, "content-length": str(len(data))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", typed.port), Handler)
    server.daemon_threads = True
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()
