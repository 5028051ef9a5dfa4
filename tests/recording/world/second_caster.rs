//! `mirror_visible` by a second caster that shares no code with the first. It reflects each ray at the glass and
//! follows it through the shapes in a log. The first caster looks from the mirrored eye instead.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::{Body, PaneKind};
use mirrorstats_log::write::{Form, Solid};
use mirrorstats_sim::model::Item;
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::scene::{HungPane, Scene};
use mirrorstats_sim::snapshot::Snapshot;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::Action;

use super::poses::{face_mirror, shaped};

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn along(a: Vector, length: f64, b: Vector) -> Vector {
    [a[0] + length * b[0], a[1] + length * b[1], a[2] + length * b[2]]
}

/// A vector rotated by a unit quaternion: v + 2w (q x v) + 2 q x (q x v).
fn turned(rotation: [f64; 4], vector: Vector) -> Vector {
    let [w, x, y, z] = rotation;
    let cross = |by: Vector| [y * by[2] - z * by[1], z * by[0] - x * by[2], x * by[1] - y * by[0]];
    let once = cross(vector);
    along(along(vector, 2.0 * w, once), 2.0, cross(once))
}

/// The distance at which a ray meets a shape at the origin with axis z; `None` if it is not ahead.
fn meets(form: Form, from: Vector, ray: Vector) -> Option<f64> {
    match form {
        Form::Sphere(radius) => ball(radius, from, ray),
        Form::Capsule { radius, length } => {
            let ends = [0.5, -0.5].map(|end| ball(radius, along(from, -end * length, [0.0, 0.0, 1.0]), ray));
            let flat = |vector: Vector| [vector[0], vector[1], 0.0];
            let side = nearest_root(dot(flat(ray), ray), dot(flat(from), ray), dot(flat(from), from) - radius * radius);
            let side = side.filter(|far| (from[2] + far * ray[2]).abs() <= length / 2.0);
            ends.into_iter().flatten().chain(side).min_by(f64::total_cmp)
        }
        Form::Box(edges) => {
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            for axis in 0..3 {
                let [one, other] = [-0.5, 0.5].map(|half| (half * edges[axis] - from[axis]) / ray[axis]);
                (near, far) = (near.max(one.min(other)), far.min(one.max(other)));
            }
            (near <= far && near > 0.0).then_some(near)
        }
        Form::Plane(sides) => {
            let far = -from[2] / ray[2];
            let is_on = [0, 1].iter().all(|axis| (from[*axis] + far * ray[*axis]).abs() <= sides[*axis] / 2.0);
            (far > 0.0 && ray[2] < 0.0 && is_on).then_some(far)
        }
    }
}

fn ball(radius: f64, from: Vector, ray: Vector) -> Option<f64> {
    nearest_root(dot(ray, ray), dot(from, ray), dot(from, from) - radius * radius)
}

/// The smaller root of a x^2 + 2 b x + c, if positive.
fn nearest_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let root = b * b - a * c;
    (a > 1e-12 && root >= 0.0).then(|| (-b - root.sqrt()) / a).filter(|far| *far > 0.0)
}

type Named<'a> = (Item, &'a Solid);

fn those(snapshot: &Snapshot, is_wanted: impl Fn(Item) -> bool) -> Vec<Named<'_>> {
    let solids = snapshot.items.iter().copied().zip(&snapshot.solids);
    solids.filter(|(item, _)| is_wanted(*item)).collect()
}

/// The first solid that a ray meets.
fn first<'a>(solids: &[Named<'a>], origin: Vector, ray: Vector) -> Option<(f64, Named<'a>)> {
    let met = solids.iter().filter_map(|(item, solid)| {
        let [turn, axis @ ..] = solid.rotation;
        let back = [turn, -axis[0], -axis[1], -axis[2]];
        let from = turned(back, along(origin, -1.0, solid.position));
        Some((meets(solid.form, from, turned(back, ray))?, (*item, *solid)))
    });
    met.min_by(|one, other| one.0.total_cmp(&other.0))
}

/// The number of pixels that show the own body through a mirror; `past` holds all moments up to now.
fn own_px(world: &World, past: &[Snapshot]) -> u32 {
    let now = past.last().unwrap();
    let eye = now.frames.iter().find(|frame| frame.name == "eye").unwrap();
    let [ahead, right, up] =
        [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turned(eye.rotation, axis));
    let view = &world.config().eye;
    let (width, height) = (view.width, view.height_px);
    let half = (view.fovy / 2.0).to_radians().tan();
    let is_thing = |item: Item| !matches!(item, Item::Room | Item::Pane(_));
    let things = those(now, is_thing);
    let panes = those(now, |item| matches!(item, Item::Pane(_)));
    // The things that a pane shows, with its delay.
    let shown_in = |pane: &HungPane| {
        let then = &past[past.len().saturating_sub(1 + pane.delay as usize)];
        those(then, is_thing)
    };
    let shown: Vec<Vec<Named<'_>>> = world.scene().panes.iter().map(shown_in).collect();
    let mut count = 0;
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let u = (2.0 * (f64::from(x) + 0.5) / f64::from(width) - 1.0) * half * f64::from(width) / f64::from(height);
        let v = (1.0 - 2.0 * (f64::from(y) + 0.5) / f64::from(height)) * half;
        let ray = along(along(ahead, u, right), v, up);
        let Some((far, (item, glass))) = first(&panes, eye.position, ray) else { continue };
        let Item::Pane(at) = item else { continue };
        let pane = &world.scene().panes[at];
        if pane.kind == PaneKind::Window || pane.double.is_some() {
            continue;
        }
        if first(&things, eye.position, ray).is_some_and(|(nearer, _)| nearer < far) {
            continue;
        }
        let normal = turned(glass.rotation, [0.0, 0.0, 1.0]);
        let reflected = along(ray, -2.0 * dot(ray, normal), normal);
        let met = first(&shown[at], along(eye.position, far, ray), reflected);
        let is_own = |item: Item| match item {
            Item::Agent(agent) => agent == 0,
            Item::Mark(mark) => world.scene().marks[mark].wearer == 0,
            _ => false,
        };
        count += u32::from(met.is_some_and(|(_, (item, _))| is_own(item)));
    }
    count
}

/// Compares both casters along walks in built-in experiments, until `views` views are compared.
fn compare(shape: Body, views: usize) {
    let names = ["E1", "E4", "E5", "two-mirrors", "delayed", "decoy", "window", "mark"];
    let config = shaped(shape);
    let mut chance = Rng::for_run(4711, 1, 1);
    let (mut compared, mut seen) = (0, 0);
    for (name, seed) in (1..).flat_map(|seed| names.map(|name| (name, seed))) {
        let scene = Scene::draw(&config, Experiment::parse(name).unwrap(), seed, 1).unwrap();
        let mut world = World::new(&config, scene).unwrap();
        // Few walks from a scene's own start come before the mirror.
        face_mirror(&mut world, 2.5, 0);
        let placed = world.figures()[0];
        world.place_at(placed, 1);
        let mut past = vec![world.snapshot()];
        for t in 1..=24 {
            let visibility = world.visibility();
            // Views without glass show little: only every eighth of those, and all others.
            if visibility.mirror_px > 0 || t % 8 == 0 {
                let own = own_px(&world, &past);
                let place = format!("{name}, seed {seed}, step {t}: {own} px, {} by the first", visibility.self_px);
                assert_eq!(own >= config.evidence.mirror_self_px, world.is_mirror_visible(&visibility), "{place}");
                assert!(own.abs_diff(visibility.self_px) <= 2 + own / 500, "{place}");
                compared += 1;
                seen += usize::from(world.is_mirror_visible(&visibility));
            }
            if compared == views {
                println!("{compared} views, the own body in {seen} of them");
                assert!(seen * 20 > views, "{seen} of {views}");
                return;
            }
            let walk = [Action::MoveForward, Action::MoveForward, Action::TurnLeft, Action::TurnRight];
            world.act(Some(chance.one_of(&walk)));
            past.push(world.snapshot());
        }
    }
}

#[test]
fn a_second_caster_agrees_on_what_the_mirror_shows() {
    compare(Body::Mannequin, 16);
    compare(Body::Humanoid, 8);
}

#[test]
#[ignore = "`make soak`: half an hour"]
fn soak_a_second_caster_agrees_on_five_thousand_views() {
    compare(Body::Mannequin, 5_000);
    compare(Body::Humanoid, 200);
}
