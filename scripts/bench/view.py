"""Times `mirrorstats view` beside Inspect View in Chromium, in turns, and writes a table in Markdown.

    python3 view.py --program mirrorstats --inspect inspect --data FOLDER --rounds 5

FOLDER has, as `make bench-view` makes them: `list` (traces of 10,000 episodes), `steps` (20 episodes of 100 steps with frames), and
`inspect/list` and `inspect/steps`, logs of the same size that `inspect_logs.py` makes with Inspect's own `eval`. Each round starts
both servers anew, and gives each a new browser context, so that nothing is cached. A page is usable when what was asked for is
drawn: the first rows of the list, the frame of an episode and its step. Times are those of the browser's own clock, from the
click or the call for the address on.
"""

import argparse
import pathlib
import re
import socket
import statistics
import subprocess
import time
import urllib.request

from playwright.sync_api import sync_playwright

# In the page: does something, and resolves with the ms until `ready()` holds, looked at in every frame that is drawn.
TIMED = """([start, ready]) => new Promise((done, fail) => {
  const [begin, holds] = [new Function(start), new Function("return " + ready)];
  const from = performance.now();
  begin();
  const look = () => {
    if (holds()) done(performance.now() - from);
    else if (performance.now() - from > 60000) fail(new Error("not within a minute: " + ready));
    else requestAnimationFrame(look);
  };
  look();
})"""

# Of an address: its own clock starts with the navigation.
LOADED = """(ready) => new Promise((done, fail) => {
  const holds = new Function("return " + ready);
  const look = () => {
    if (holds()) done(performance.now());
    else if (performance.now() > 60000) fail(new Error("not within a minute: " + ready));
    else requestAnimationFrame(look);
  };
  look();
})"""


class Server:
    """A server of one of the two, with its address."""

    def __init__(self, command, address):
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        self.address = address
        for _ in range(600):
            try:
                urllib.request.urlopen(address, timeout=5).read(1)
                return
            except OSError:
                if self.process.poll() is not None:
                    raise SystemExit(f"{command[0]} ended with {self.process.returncode}")
                time.sleep(0.1)
        raise SystemExit(f"{address} does not answer")

    def megabytes(self):
        """Resident memory of the server and its children, MB."""
        pids, total = [self.process.pid], 0
        while pids:
            pid = pids.pop()
            status = pathlib.Path(f"/proc/{pid}/status").read_text()
            total += int(re.search(r"VmRSS:\s+(\d+)", status)[1])
            for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
                pids += [int(child) for child in (task / "children").read_text().split()]
        return total / 1024

    def close(self):
        self.process.terminate()
        self.process.wait()


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def mirrorstats(program, folder):
    port = free_port()
    return Server([program, "view", str(folder), "--no-open", "--no-token", "--port", str(port)], f"http://127.0.0.1:{port}/")


def inspect(program, folder):
    port = free_port()
    return Server([program, "view", "--log-dir", str(folder), "--port", str(port)], f"http://127.0.0.1:{port}/")


def own_round(page, data, program, found):
    rows = "document.querySelectorAll('a[role=row][data-id]').length > 5"
    frame = "(() => { const i = document.querySelector('img.frame'); return i && i.complete && i.naturalWidth > 0 })()"
    server = mirrorstats(program, data / "list")
    page.goto(server.address + "?view=episodes", wait_until="commit")
    found("list of 10,000 episodes", page.evaluate(LOADED, rows))
    found("server after the list, MB", server.megabytes())
    server.close()
    server = mirrorstats(program, data / "steps")
    page.goto(server.address + "?view=episodes", wait_until="commit")
    page.evaluate(LOADED, rows)
    open_first = "document.querySelector('a[role=row][data-id]').click()"
    found("an episode of 100 steps with frames", page.evaluate(TIMED, [open_first, frame]))
    press = "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true}))"
    for step in range(2, 22):
        shown = f"(() => {{ const i = document.querySelector('img.frame'); return i.alt.endsWith('= {step}') && i.complete && i.naturalWidth > 0 }})()"
        found("next frame", page.evaluate(TIMED, [press, shown]))
    found("server after an episode, MB", server.megabytes())
    server.close()


def inspect_round(page, data, program, found):
    log = lambda folder: next((data / "inspect" / folder).glob("*.eval")).name
    rows = "document.querySelectorAll('[role=row], .ag-row').length > 5"
    server = inspect(program, data / "inspect" / "list")
    page.goto(f"{server.address}#/logs/{log('list')}/samples", wait_until="commit")
    found("list of 10,000 episodes", page.evaluate(LOADED, rows))
    found("server after the list, MB", server.megabytes())
    server.close()
    server = inspect(program, data / "inspect" / "steps")
    page.goto(f"{server.address}#/logs/{log('steps')}/samples", wait_until="commit")
    page.evaluate(LOADED, rows)
    open_first = f"location.hash = '#/logs/{log('steps')}/samples/sample/1/1/messages'"
    image = "[...document.querySelectorAll('img')].some((i) => i.complete && i.naturalWidth >= 640)"
    found("an episode of 100 steps with frames", page.evaluate(TIMED, [open_first, image]))
    found("server after an episode, MB", server.megabytes())
    server.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--inspect", required=True)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    contenders = {
        "mirrorstats": lambda page, found: own_round(page, options.data, options.program, found),
        "Inspect View": lambda page, found: inspect_round(page, options.data, options.inspect, found),
    }
    measured = {name: {} for name in contenders}
    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
        for _ in range(options.rounds):
            for name, play in contenders.items():
                browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=arguments)
                page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
                play(page, lambda what, value: measured[name].setdefault(what, []).append(value))
                browser.close()
    print(f"| median of {options.rounds} rounds | {' | '.join(contenders)} |\n|---|{'--:|' * len(contenders)}")
    for what in measured["mirrorstats"]:
        cells = [measured[name].get(what) for name in contenders]
        unit = "" if what.endswith("MB") else " ms"
        words = [f"{statistics.median(values):.0f}{unit}" if values else "" for values in cells]
        print(f"| {what} | {' | '.join(words)} |")


if __name__ == "__main__":
    main()
