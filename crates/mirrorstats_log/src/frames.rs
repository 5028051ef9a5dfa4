//! Reads one step of a log: its frame and its shapes, found through the log's index.
//!
//! Rule: of a finished log, only the index and the chunk of the step are read. A log that is still being written has no
//! index: it is read up to its current end, and an incomplete end is not a fault.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use foxglove::Decode as _;
use foxglove::messages::{Color, Pose, Quaternion, SceneEntity, SceneUpdate, Vector3};
use mcap::Message;
use mcap::records::Record;
use serde::Serialize;

use super::chunk::{Budgets, inside};
use super::error::LogError;
use super::message::EpisodeMessage;
use super::read::{Event, Messages, event, png};
use super::records::Records;
use super::topic;
use mirrorstats_trace::episodes::episode::{Episode, Step};

#[derive(Debug)]
pub struct LogIndex {
    path: PathBuf,
    topics: BTreeMap<u16, String>,
    chunks: Vec<ChunkTimes>,
}

/// The start of a chunk, and the times of its first and its last message, ns.
#[derive(Clone, Copy, Debug)]
struct ChunkTimes {
    at: u64,
    first: u64,
    last: u64,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// The frame, PNG; `None` if none was drawn.
    pub frame: Option<Vec<u8>>,
    pub shapes: Vec<SceneShape>,
}

/// A shape seen from above.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneShape {
    /// Its name, such as `pane0`, `cube0` or `agent0_head`.
    pub name: String,
    /// Its outline on the floor: the corners in order, m.
    pub outline: Vec<[f64; 2]>,
    /// The radius of a round shape, m; its position is then the only corner.
    pub radius: Option<f64>,
    /// Red, green, blue and opacity, from 0 to 1.
    pub rgba: [f64; 4],
    /// The height of its centre, m.
    pub height: f64,
}

impl LogIndex {
    /// Reads the index of a log; `None` for an unfinished log, which has none.
    pub fn open(path: &Path) -> Result<Option<Self>, LogError> {
        let mut records = Records::open(path)?;
        let (mut topics, mut chunks) = (BTreeMap::new(), Vec::new());
        for record in records.verified_summary().map_err(LogError::io("read", path))? {
            match record {
                Record::Channel(channel) => {
                    topics.insert(channel.id, channel.topic);
                }
                Record::ChunkIndex(index) => chunks.push(ChunkTimes {
                    at: index.chunk_start_offset,
                    first: index.message_start_time,
                    last: index.message_end_time,
                }),
                _ => {}
            }
        }
        Ok((!chunks.is_empty()).then(|| Self { path: path.to_owned(), topics, chunks }))
    }

    /// Passes on the log's records of an episode's steps at these times, ns, in order; true if it has any.
    pub fn each_moment(
        &self,
        episode_id: &str,
        times: &BTreeSet<u64>,
        give: &mut dyn FnMut(u64, Moment),
    ) -> Result<bool, LogError> {
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return Ok(false) };
        let mut records = Records::open(&self.path)?;
        let mut has_any = false;
        for chunk in self.chunks.iter().filter(|chunk| chunk.first <= *last && chunk.last >= *first) {
            for (time, moment) in self.moments(&mut records, chunk, episode_id, times)? {
                give(time, moment);
                has_any = true;
            }
        }
        Ok(has_any)
    }

    /// The wanted steps of a chunk by time, ns.
    fn moments(
        &self,
        records: &mut Records<BufReader<File>>,
        chunk: &ChunkTimes,
        episode_id: &str,
        times: &BTreeSet<u64>,
    ) -> Result<BTreeMap<u64, Moment>, LogError> {
        let bytes = records.chunk_at(chunk.at).map_err(LogError::io("read", &self.path))?;
        let bytes = bytes.ok_or_else(|| self.damaged("its index names a chunk that is not there"))?;
        let unpacked = inside(&bytes, &Budgets::new(records.end)).map_err(|fault| self.damaged(&fault))?;
        let (mut moments, mut begun) = (BTreeMap::new(), Vec::new());
        for record in unpacked {
            let Record::Message { header, data } = record else { continue };
            let Some(topic) = self.topics.get(&header.channel_id) else { continue };
            if let Ok(Event::Episode(EpisodeMessage::Begin(head))) = event(topic, &data) {
                begun.push(head.episode_id == episode_id);
            }
            add(&mut moments, times, (topic, header.log_time, &data));
        }
        // If only other episodes begin in a chunk, it belongs to them. If none begins, the time decides.
        Ok(if !begun.is_empty() && !begun.contains(&true) { BTreeMap::new() } else { moments })
    }

    fn damaged(&self, fault: &str) -> LogError {
        LogError::Damaged { file: self.path.display().to_string(), fault: fault.to_owned() }
    }
}

/// The readable steps of the episode of a log that is still being written; `None` if not even its start is readable.
pub fn unfinished(path: &Path) -> Result<Option<Episode>, LogError> {
    let (mut head, mut steps): (Option<Episode>, Vec<Step>) = (None, Vec::new());
    each_message(path, |message| match event(&message.channel.topic, &message.data) {
        Ok(Event::Episode(EpisodeMessage::Begin(found))) if head.is_none() => head = Some(*found),
        Ok(Event::Decision(row)) => steps.extend(row.into_step().ok()),
        _ => {}
    })?;
    Ok(head.map(|head| Episode { steps, ..head }))
}

/// Passes on the records of the steps at these times, ns, in a log that is still being written.
pub fn each_unfinished_moment(
    path: &Path,
    times: &BTreeSet<u64>,
    give: &mut dyn FnMut(u64, Moment),
) -> Result<(), LogError> {
    let mut moments = BTreeMap::new();
    each_message(path, |message| {
        add(&mut moments, times, (&message.channel.topic, message.log_time, &message.data));
    })?;
    for (time, moment) in moments {
        give(time, moment);
    }
    Ok(())
}

pub fn is_log(path: &Path) -> bool {
    Records::open(path).is_ok()
}

/// Passes on the messages up to the end of the data, or to its damaged part.
fn each_message(path: &Path, mut give: impl FnMut(Message<'_>)) -> Result<(), LogError> {
    for message in Messages::open(path)? {
        match message {
            Ok(message) => give(message),
            Err(LogError::Damaged { .. }) => break,
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn add(moments: &mut BTreeMap<u64, Moment>, times: &BTreeSet<u64>, (topic, time, data): (&str, u64, &[u8])) {
    if topic == topic::EPISODE || !times.contains(&time) {
        return;
    }
    let moment = moments.entry(time).or_default();
    match topic {
        topic::CAMERA => moment.frame = png(data),
        topic::SCENE => moment.shapes = shapes(data),
        _ => {}
    }
}

fn shapes(data: &[u8]) -> Vec<SceneShape> {
    SceneUpdate::decode(data).map_or_else(|_| Vec::new(), |update| of_entities(&update.entities))
}

/// The shapes of a world that has no log, as a log would have them.
#[cfg(feature = "sim")]
pub fn of_solids(solids: &[super::write::Solid]) -> Vec<SceneShape> {
    of_entities(&solids.iter().map(|solid| super::write::entity(solid, None)).collect::<Vec<_>>())
}

fn of_entities(entities: &[SceneEntity]) -> Vec<SceneShape> {
    let mut shapes: Vec<SceneShape> = entities.iter().flat_map(of_entity).collect();
    shapes.sort_by(|a, b| a.height.total_cmp(&b.height));
    shapes
}

fn of_entity(entity: &SceneEntity) -> Vec<SceneShape> {
    let name = &entity.id;
    let cubes = entity.cubes.iter().filter_map(|cube| boxed(name, cube.pose.as_ref()?, cube.size?, cube.color?));
    let spheres = entity.spheres.iter().filter_map(|ball| round(name, ball.pose.as_ref()?, ball.size?, ball.color?));
    let posts = entity.cylinders.iter().filter_map(|post| round(name, post.pose.as_ref()?, post.size?, post.color?));
    cubes.chain(spheres).chain(posts).collect()
}

fn boxed(name: &str, pose: &Pose, size: Vector3, color: Color) -> Option<SceneShape> {
    let (at, turn) = (pose.position?, pose.orientation?);
    let corner = |x: f64, y: f64, z: f64| {
        let [dx, dy, _] = turned(turn, [x * size.x / 2.0, y * size.y / 2.0, z * size.z / 2.0]);
        [at.x + dx, at.y + dy]
    };
    let sign = |corner: u8, axis: u8| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    let outline = hull((0..8).map(|of| corner(sign(of, 0), sign(of, 1), sign(of, 2))).collect());
    Some(SceneShape { name: name.to_owned(), outline, radius: None, rgba: rgba(color), height: at.z })
}

fn round(name: &str, pose: &Pose, size: Vector3, color: Color) -> Option<SceneShape> {
    let at = pose.position?;
    let radius = Some(size.x / 2.0);
    Some(SceneShape { name: name.to_owned(), outline: vec![[at.x, at.y]], radius, rgba: rgba(color), height: at.z })
}

fn rgba(color: Color) -> [f64; 4] {
    [color.r, color.g, color.b, color.a]
}

fn turned(turn: Quaternion, vector: [f64; 3]) -> [f64; 3] {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let axis = [turn.x, turn.y, turn.z];
    let once = cross(axis, vector).map(|part| 2.0 * part);
    let twice = cross(axis, once);
    std::array::from_fn(|at| vector[at] + turn.w * once[at] + twice[at])
}

/// The corners of the convex hull of points; one point if all are the same.
pub fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = kept[..]
                && (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) <= 1e-12
            {
                kept.pop();
            }
            kept.push(point);
        }
        kept.pop();
        kept
    };
    let mut outline = half(&mut points.iter().copied());
    outline.extend(half(&mut points.iter().rev().copied()));
    if outline.is_empty() {
        points.truncate(1);
    } else {
        points = outline;
    }
    points
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{LogIndex, Moment, Quaternion, hull, turned, unfinished};
    use crate::read::{Event, LogReader, png};

    #[test]
    fn the_index_finds_every_frame_of_a_full_scan() {
        let log = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/recorded/E1-guesser.mcap"));
        let index = LogIndex::open(log).unwrap().unwrap();
        let step = |id: &str, time| {
            let mut found: Vec<Moment> = Vec::new();
            index.each_moment(id, &[time].into(), &mut |_, moment| found.push(moment)).unwrap();
            found
        };
        let mut id = String::new();
        let mut frames = 0;
        for message in LogReader::open(log).unwrap().map(Result::unwrap) {
            match message.event {
                Event::Episode(crate::message::EpisodeMessage::Begin(head)) => id = head.episode_id,
                Event::Frame(image) => {
                    let [found] = step(&id, message.time).try_into().unwrap();
                    assert_eq!(found.frame, png(&image));
                    assert!(found.shapes.iter().any(|shape| shape.name.starts_with("cube")));
                    frames += 1;
                }
                _ => {}
            }
        }
        assert!(frames > 0);
        assert_eq!(step("E1/nobody/s1/r1", 0), []);
    }

    #[test]
    fn a_truncated_log_has_no_index_but_can_be_read() {
        let log =
            std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/recorded/E1-guesser.mcap")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let cut = folder.path().join("cut");
        for length in [8, log.len() / 3, log.len() - 1] {
            std::fs::write(&cut, &log[..length]).unwrap();
            assert!(LogIndex::open(&cut).unwrap().is_none(), "{length}");
            unfinished(&cut).unwrap();
        }
        std::fs::write(&cut, &log[..4]).unwrap();
        assert!(unfinished(&cut).is_err());
    }

    #[test]
    fn a_damaged_index_is_not_used() {
        let mut log =
            std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/recorded/E1-guesser.mcap")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.mcap");
        // The last bytes are the footer, 20 bytes, and the magic number, 8 bytes.
        let start = log.len() - 8 - 20;
        let index = usize::try_from(u64::from_le_bytes(*log[start..].first_chunk().unwrap())).unwrap();
        for at in (index..start + 16).step_by(97) {
            log[at] ^= 1;
            std::fs::write(&path, &log).unwrap();
            assert!(LogIndex::open(&path).unwrap().is_none(), "{at}");
            log[at] ^= 1;
        }
    }

    #[test]
    fn a_quarter_turn_and_a_hull() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let [x, y, _] = turned(Quaternion { x: 0.0, y: 0.0, z: half, w: half }, [1.0, 0.0, 0.0]);
        assert!(x.abs() < 1e-9 && (y - 1.0).abs() < 1e-9);
        let square = vec![[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.5, 0.5]];
        assert_eq!(hull(square), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(hull(vec![[2.0, 3.0]; 3]), [[2.0, 3.0]]);
    }
}
