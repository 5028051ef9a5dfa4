"""An agent that sees: pixels in, replies out, behind OpenAI's chat completions on loopback.

    python3 seeing.py --port 8080
    mirrorstats record --agent vlm --model seeing --base-url http://127.0.0.1:8080/v1 --experiment E1 --out runs

It keeps nothing between requests: its memory is the `summary` of its reply, which the next prompt repeats. So equal
requests get equal replies, and any number of episodes may play at once. With --trained it recognises the mirror and its
own body by a small network instead of by geometry; docs/how-to/seeing-agent.md says what both know beforehand.
"""

import argparse
import base64
import heapq
import json
import math
import re
import threading
import zlib
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import sight
from sight import COLORS, PIECE, PIECES, RADIUS, ROOM, SIDES, STEP

NEAR = 1.0  # from the middle of a cube, m: at most one step away
BEFORE_MIRROR = (0.9, 2.8)  # good distances from the mirror, m
AROUND_CUBE = 0.73  # from the middle of a cube to the own axis, m
TESTS, PLACES = 3, 2  # sightings of the own body, and different places, that settle its colour
RESERVE = 32  # steps left at which an unsettled agent guesses
LOOKOUTS = 3
MARGIN = RADIUS + 0.02  # from a wall to the own axis, m
WAYS = [(math.cos(math.radians(30 * turn)), math.sin(math.radians(30 * turn))) for turn in range(12)]


class Geometry:
    """Finds the mirror by the floor beyond the room, and itself as the body where the own reflection has to be."""

    def look(self, view, mirror):
        """Votes on pieces of wall, and the colour of the own body if this view shows it. `mirror` is what is known."""
        own = None
        if mirror and mirror[1] <= along(mirror[0], (view.x, view.y)) <= mirror[2]:
            own = view.body_at(view.reflected(mirror[0]))
        return view.mirror_votes(), own


class Memory:
    """What the agent keeps from step to step, as one line of JSON."""

    def __init__(self, text=None):
        kept = json.loads(text) if text else {}
        # Nine for a mirror, zero for a wall, five where nothing is known; from west to east or south to north.
        self.walls = [[int(digit) for digit in wall] for wall in kept.get("walls", ["5" * PIECES] * len(SIDES))]
        self.own = kept.get("own", [])  # sightings of the own body: colour, x, y
        self.cubes = kept.get("cubes", [])  # colour, x, y, distance when seen
        self.tried = kept.get("tried", [])  # places from which it looked into the mirror
        self.lookouts = kept.get("lookouts", [])  # places from which it has looked around
        self.seen = kept.get("seen", [])  # headings seen from the current place
        self.bumps = kept.get("bumps", [])  # x, y, steps for which it is avoided
        self.guess = kept.get("guess")
        self.claimed = kept.get("claimed", False)

    def text(self):
        kept = {**vars(self), "walls": ["".join(map(str, wall)) for wall in self.walls]}
        return json.dumps({key: value for key, value in kept.items() if value}, separators=(",", ":"))

    def mirror(self):
        """Side, and the two ends along its wall, m; None if it has seen no mirror."""
        pieces = [[at for at, votes in enumerate(wall) if votes >= 7] for wall in self.walls]
        side = max(range(len(SIDES)), key=lambda at: len(pieces[at]))
        found = pieces[side]
        if len(found) < 3:
            return None
        return side, found[0] * PIECE - ROOM / 2, (found[-1] + 1) * PIECE - ROOM / 2

    def color(self):
        """The colour on which sightings from several places agree."""
        by_color = {name: [(x, y) for color, x, y in self.own if color == name] for name, _, _ in self.own}
        if not by_color:
            return None
        best = max(by_color, key=lambda name: len(by_color[name]))
        places = by_color[best]
        agree = len(places) >= TESTS and 3 * len(places) >= 2 * len(self.own)
        return best if agree and len(apart(places, 0.1)) >= PLACES else None

    def cube(self, color):
        of_color = [cube for cube in self.cubes if cube[0] == color]
        return min(of_color, key=lambda cube: cube[3])[1:3] if of_color else None


class Step:
    """One decision: where the agent is, what it sees, and what it remembers."""

    def __init__(self, eyes, picture, prompt):
        x, y, yaw = (float(number) for number in re.search(
            r"x = (-?[\d.]+) m, y = (-?[\d.]+) m; orientation: (-?[\d.]+) degrees", prompt).groups())
        self.left = int(re.search(r"Remaining steps: (\d+)", prompt).group(1))
        thoughts = re.findall(r"the thought (?:with|before) it was: (\{.*\})", prompt)
        self.memory = Memory(thoughts[-1] if thoughts else None)
        self.place, self.heading = (x, y), round(yaw / 30) % 12
        self.view = sight.View(picture, x, y, yaw)
        self.see(eyes)
        if "Warning: the previous movement" in prompt:
            way = -0.7 if "the previous action was s;" in prompt else 0.7
            dx, dy = WAYS[self.heading]
            self.memory.bumps.append([round(x + way * dx, 2), round(y + way * dy, 2), 6])

    def see(self, eyes):
        memory = self.memory
        votes, own = eyes.look(self.view, memory.mirror())
        for side, wall in enumerate(memory.walls):
            for at in range(PIECES):
                vote = int(votes[side][at])
                wall[at] = min(9, max(0, wall[at] + (vote >= 2) - (vote <= -2)))
        if own:
            memory.own = [*memory.own, [own, *self.place]][-12:]
        for color, x, y, away in self.view.cubes():
            same = [cube for cube in memory.cubes if cube[0] == color and math.dist(cube[1:3], (x, y)) < 0.7]
            if away < 5 and all(away <= cube[3] for cube in same):
                memory.cubes = [cube for cube in memory.cubes if cube not in same] + [[color, x, y, away]]
        memory.bumps = [[x, y, steps - 1] for x, y, steps in memory.bumps if steps > 1]

    def decide(self, asks_for_cube):
        """The action, the selected cube, and the reason."""
        memory, known = self.memory, self.memory.color()
        if known:
            choice, reason = known, f"I have seen my own body several times, and it was {known}"
        else:
            choice, reason = self.guessed(asks_for_cube), "I have not recognised my body; this is a guess"
        action, cube = "a", "none"
        if choice is None:
            action, reason = self.look_for_mirror(), "I have not recognised my body yet"
        elif not asks_for_cube:
            action = "done" if memory.claimed else "a"
        else:
            at = memory.cube(choice)
            if at and memory.claimed and math.dist(self.place, at) <= NEAR:
                action, cube = "done", choice
            else:
                action = (at and self.walk(lambda pose: math.dist(pose[0], at) <= NEAR, at)) or self.look_around()
        if self.left <= 1:
            action, cube = "done", choice if choice and asks_for_cube else "none"
        memory.claimed = memory.claimed or choice is not None
        return action, cube, reason

    def guessed(self, asks_for_cube):
        """A cube by chance, once there is no hope of better; kept from then on."""
        memory = self.memory
        hopeless = self.left <= RESERVE or (len(memory.lookouts) >= LOOKOUTS and not memory.mirror())
        if asks_for_cube and not memory.guess and hopeless and memory.cubes:
            by_color = sorted({cube[0] for cube in memory.cubes})
            likely = [color for color, _, _ in memory.own if color in by_color]
            memory.guess = likely[-1] if likely else by_color[round(100 * sum(map(abs, self.place))) % len(by_color)]
        return memory.guess

    def look_for_mirror(self):
        memory, mirror = self.memory, self.memory.mirror()
        if not mirror:
            return self.look_around()
        if is_before(mirror, (self.place, self.heading)):
            memory.tried = [*memory.tried, self.place][-12:]

        def is_new(pose):
            return is_before(mirror, pose) and all(math.dist(pose[0], tried) > 0.3 for tried in memory.tried)

        return self.walk(is_new) or self.look_around()

    def look_around(self):
        """Turns until it has seen every direction, then does so from other places."""
        memory = self.memory
        if self.heading not in memory.seen:
            memory.seen.append(self.heading)
        behind = [turn for turn in range(12) if all((turn - seen + 2) % 12 > 4 for seen in memory.seen)]
        spots = [(x * ROOM, y * ROOM) for x, y in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25), (0, 0))]
        goal = max(spots, key=lambda spot: min((math.dist(spot, seen) for seen in memory.lookouts), default=0))
        is_there = not memory.lookouts or math.dist(self.place, goal) < 0.5
        step = None if is_there else self.walk(lambda pose: math.dist(pose[0], goal) < 0.5, goal)
        if step:
            memory.seen = []
        elif not behind:
            memory.lookouts = [*memory.lookouts, self.place][-LOOKOUTS:]
            memory.seen = []
        return step or "a"

    def walk(self, is_goal, towards=None):
        """The first action of the cheapest way to a pose; None if there is no way, or it is there."""
        blocks = [(cube[1:3], AROUND_CUBE) for cube in self.memory.cubes] + [(b[:2], 0.55) for b in self.memory.bumps]
        start = (self.place, self.heading)
        queue, closed, count = [(0, 0, 0, start, None)], set(), 0
        while queue and len(closed) < 4000:
            _, cost, _, pose, first = heapq.heappop(queue)
            if is_goal(pose):
                return first
            (x, y), heading = pose
            key = (round(x / 0.2), round(y / 0.2), heading)
            if key in closed:
                continue
            closed.add(key)
            dx, dy = WAYS[heading]
            for action, price, place, turned in (
                ("w", 10, (x + STEP * dx, y + STEP * dy), heading),
                ("a", 9, (x, y), (heading + 1) % 12),
                ("d", 9, (x, y), (heading - 1) % 12),
                ("s", 16, (x - STEP * dx, y - STEP * dy), heading),
            ):
                if action in "ws" and not is_free((x, y), place, blocks):
                    continue
                count += 1
                rest = 10 * max(0, math.dist(place, towards) - NEAR) / STEP if towards else 0
                heapq.heappush(queue, (cost + price + rest, cost + price, count, (place, turned), first or action))
        return None


def is_free(start, end, blocks):
    if max(map(abs, end)) > ROOM / 2 - MARGIN:
        return False
    return all(math.dist(end, at) >= away or math.dist(end, at) > math.dist(start, at) for at, away in blocks)


def apart(places, least):
    kept = []
    for place in places:
        if all(math.dist(place, other) > least for other in kept):
            kept.append(place)
    return kept


def along(side, place):
    return place[1] if SIDES[side][0] else place[0]


def is_before(mirror, pose):
    """True if a pose looks straight into the mirror, or 30 degrees aside, from a good distance."""
    side, first, last = mirror
    out = SIDES[side][0] * pose[0][0] + SIDES[side][1] * pose[0][1]
    near = BEFORE_MIRROR[0] <= ROOM / 2 - out <= BEFORE_MIRROR[1]
    return near and first <= along(side, pose[0]) <= last and (pose[1] - 3 * side + 1) % 12 <= 2


def reply(eyes, messages):
    """The reply to a request's messages, by the keys that its prompt asks for."""
    system, parts = messages[0]["content"], messages[1]["content"]
    prompt = next(part["text"] for part in parts if part["type"] == "text")
    url = next(part["image_url"]["url"] for part in parts if part["type"] == "image_url")
    keys = re.findall(r'"([\w-]+)"', system.split("exactly these keys:")[1].split(".\n")[0])
    step = Step(eyes, sight.decode_png(base64.b64decode(url.split(",", 1)[1])), prompt)
    action, cube, reason = step.decide("selected_cube" in keys)
    known, cubes = step.memory.color(), sorted({cube[0] for cube in step.memory.cubes})
    said = {
        "view-description": f"cubes so far: {', '.join(cubes) or 'none'}; mirror: {step.memory.mirror() or 'not seen'}",
        "reasoning": reason, "action": action, "summary": step.memory.text(), "selected_cube": cube, "mark": "none",
        "identification": f"My body is {known}." if known else "unknown",
    }
    return json.dumps({key: said[key] for key in keys})


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    eyes = Geometry()
    # The pictures of several episodes at once would only compete for the interpreter.
    turn = threading.Lock()

    def do_POST(self):
        sent = self.rfile.read(int(self.headers["content-length"]))
        try:
            body = json.loads(sent)
            with self.turn:
                text = reply(self.eyes, body["messages"])
        except (AttributeError, IndexError, KeyError, StopIteration, TypeError, ValueError, zlib.error) as error:
            message = f"this agent plays prompts like those of E1 to E5, and cannot read this request: {error!r}"
            return self.say(400, {"error": {"type": "invalid_request_error", "message": message}})
        choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": text}}
        self.say(200, {"object": "chat.completion", "model": body["model"], "choices": [choice]})

    def say(self, status, body):
        data = json.dumps(body).encode()
        self.send_response(status)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_):
        pass


def main():
    parser = argparse.ArgumentParser(description="An agent that sees, behind an OpenAI-compatible endpoint.")
    parser.add_argument("--port", type=int, default=0, help="0 picks a free one, and prints it")
    parser.add_argument("--trained", metavar="NPZ", help="weights of train_seeing.py: a network looks for mirror and body")
    typed = parser.parse_args()
    if typed.trained:
        import network
        try:
            Handler.eyes = network.Network.load(typed.trained)
        except (OSError, ValueError) as error:
            parser.error(f"--trained: {error}")
    server = ThreadingHTTPServer(("127.0.0.1", typed.port), Handler)
    server.daemon_threads = True
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
