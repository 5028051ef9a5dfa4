//! Writes the log of one episode while it is played.

use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use foxglove::messages::{
    Color, CompressedImage, CubePrimitive, CylinderPrimitive, FrameTransform, FrameTransforms, Pose, Quaternion,
    SceneEntity, SceneUpdate, SpherePrimitive, Timestamp, Vector3,
};
use foxglove::{Encode, Schema};
use mcap::Writer;
use mcap::records::MessageHeader;
use schemars::schema_for;
use serde::Serialize;
use serde_json::json;

use super::assemble::writer;
use super::error::LogError;
use super::message::{Decision, EpisodeMessage};
use super::topic;
use mirrorstats_exact::replace::NewFile;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::episodes::episode_hash;

/// A moving object, in the frame of the room.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    pub name: String,
    /// In m.
    pub position: [f64; 3],
    /// A unit quaternion: w, x, y, z.
    pub rotation: [f64; 4],
}

/// A shape in the frame of the room.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    pub name: String,
    pub form: Form,
    /// The position of its centre, m.
    pub position: [f64; 3],
    /// A unit quaternion: w, x, y, z.
    pub rotation: [f64; 4],
    /// Red, green, blue and opacity, from 0 to 1.
    pub rgba: [f32; 4],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A rectangle with these full sides along x and y, its front to +z.
    Plane([f64; 2]),
    /// A box with these edges.
    Box([f64; 3]),
    Sphere(f64),
    /// A capsule along z: the radius, and the length of the cylinder between its round ends.
    Capsule {
        radius: f64,
        length: f64,
    },
}

/// The perception before a step.
#[derive(Clone, Debug)]
pub struct View<'a, C> {
    /// The frame, PNG; `None` if none was drawn.
    pub png: Option<&'a [u8]>,
    pub placed: &'a [Placed],
    /// Everything, as shapes.
    pub solids: &'a [Solid],
    pub census: &'a C,
}

const ROOM: &str = "room";

/// The log of a running episode. It is a temporary file until the episode ends, and is removed if it does not.
pub struct EpisodeLog {
    path: PathBuf,
    out: Writer<Out>,
    channels: BTreeMap<&'static str, u16>,
    sequence: u32,
    is_read_meanwhile: bool,
}

type Out = BufWriter<NewFile>;

impl EpisodeLog {
    /// Starts the log for `path`; `census` is the JSON Schema of a census.
    pub fn create(path: &Path, head: &Episode, census: &serde_json::Value, time: u64) -> Result<Self, LogError> {
        let file = NewFile::create(path).map_err(LogError::io("write", path))?;
        let mut out = writer(BufWriter::new(file)).map_err(LogError::writing(path))?;
        let channels = channels(&mut out, census).map_err(LogError::writing(path))?;
        let mut log = Self { path: path.to_owned(), out, channels, sequence: 0, is_read_meanwhile: true };
        // The hash of its rows is not known before its end, which holds it.
        let head = Episode { episode_hash: None, ..head.clone() };
        log.json(topic::EPISODE, time, &EpisodeMessage::Begin(Box::new(head)))?;
        log.flush()?;
        Ok(log)
    }

    pub fn seen<C: Serialize>(&mut self, time: u64, view: &View<'_, C>) -> Result<(), LogError> {
        let stamp = Timestamp::new_checked(u32::try_from(time / 1_000_000_000).unwrap_or(u32::MAX), 0);
        if let Some(png) = view.png {
            let image = CompressedImage {
                timestamp: stamp,
                frame_id: "eye".to_owned(),
                data: png.to_vec().into(),
                format: "png".to_owned(),
            };
            self.protobuf(topic::CAMERA, time, &image)?;
        }
        let transforms = view.placed.iter().map(|placed| transform(placed, stamp)).collect();
        self.protobuf(topic::TRANSFORMS, time, &FrameTransforms { transforms })?;
        let entities = view.solids.iter().map(|solid| entity(solid, stamp)).collect();
        self.protobuf(topic::SCENE, time, &SceneUpdate { deletions: Vec::new(), entities })?;
        self.json(topic::CENSUS, time, view.census)
    }

    pub fn decided(&mut self, time: u64, row: &Decision) -> Result<(), LogError> {
        self.json(topic::DECISION, time, row)?;
        if self.is_read_meanwhile { self.flush() } else { Ok(()) }
    }

    /// Uses chunks of many steps, which are smaller, for a log that is only read after it has ended.
    #[must_use]
    pub fn in_large_chunks(self) -> Self {
        Self { is_read_meanwhile: false, ..self }
    }

    /// Ends the chunk of a step, so that others can read it during the episode.
    fn flush(&mut self) -> Result<(), LogError> {
        self.out.flush().map_err(LogError::writing(&self.path))
    }

    /// Ends the log of an episode with the hash of its rows, and gives the log its name.
    pub fn end(mut self, time: u64, episode: &Episode) -> Result<(), LogError> {
        let Episode { episode_id, steps, fingerprint, .. } = episode;
        let end = EpisodeMessage::End {
            episode_id: episode_id.clone(),
            steps: steps.len(),
            fingerprint: fingerprint.clone(),
            episode_hash: Some(episode_hash::hash_of(episode)),
        };
        self.json(topic::EPISODE, time, &end)?;
        self.out.finish().map_err(LogError::writing(&self.path))?;
        let failed = |error| LogError::io("write", &self.path)(error);
        let file = self.out.into_inner().into_inner().map_err(|error| failed(error.into_error()))?;
        file.commit().map_err(failed)
    }

    fn json(&mut self, topic: &str, time: u64, message: &impl Serialize) -> Result<(), LogError> {
        let data = serde_json::to_vec(message).map_err(|error| LogError::io("write", &self.path)(error.into()))?;
        self.write(topic, time, &data)
    }

    fn protobuf(&mut self, topic: &str, time: u64, message: &impl Encode) -> Result<(), LogError> {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or_default());
        let encoded = message.encode(&mut data);
        encoded.map_err(|error| LogError::io("write", &self.path)(std::io::Error::other(error.to_string())))?;
        self.write(topic, time, &data)
    }

    fn write(&mut self, topic: &str, time: u64, data: &[u8]) -> Result<(), LogError> {
        self.sequence += 1;
        let channel_id = self.channels[topic];
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.out.write_to_known_channel(&header, data).map_err(LogError::writing(&self.path))
    }
}

fn channels(out: &mut Writer<Out>, census: &serde_json::Value) -> mcap::McapResult<BTreeMap<&'static str, u16>> {
    let json = [
        (topic::EPISODE, "mirrorstats.Episode", json!(schema_for!(EpisodeMessage))),
        (topic::CENSUS, "mirrorstats.Census", census.clone()),
        (topic::DECISION, "mirrorstats.Decision", json!(schema_for!(Decision))),
    ];
    let protobuf = [
        (topic::CAMERA, CompressedImage::get_schema()),
        (topic::TRANSFORMS, FrameTransforms::get_schema()),
        (topic::SCENE, SceneUpdate::get_schema()),
    ];
    let mut channels = BTreeMap::new();
    for (topic, title, schema) in json {
        let schema = out.add_schema(title, "jsonschema", schema.to_string().as_bytes())?;
        channels.insert(topic, out.add_channel(schema, topic, "json", &BTreeMap::new())?);
    }
    for (topic, schema) in protobuf {
        let add = |schema: Schema| out.add_schema(&schema.name, &schema.encoding, &schema.data);
        let schema = schema.map_or(Ok(0), add)?;
        channels.insert(topic, out.add_channel(schema, topic, "protobuf", &BTreeMap::new())?);
    }
    Ok(channels)
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn quaternion([w, x, y, z]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}

fn transform(placed: &Placed, timestamp: Option<Timestamp>) -> FrameTransform {
    FrameTransform {
        timestamp,
        parent_frame_id: ROOM.to_owned(),
        child_frame_id: placed.name.clone(),
        translation: Some(vector(placed.position)),
        rotation: Some(quaternion(placed.rotation)),
    }
}

/// One entity per shape with its name, so that the next step's entity replaces it.
pub(crate) fn entity(solid: &Solid, timestamp: Option<Timestamp>) -> SceneEntity {
    let [r, g, b, a] = solid.rgba.map(f64::from);
    let color = Some(Color { r, g, b, a });
    let pose = Some(Pose { position: Some(vector(solid.position)), orientation: Some(quaternion(solid.rotation)) });
    let mut entity =
        SceneEntity { timestamp, frame_id: ROOM.to_owned(), id: solid.name.clone(), ..SceneEntity::default() };
    match solid.form {
        Form::Plane([width, height]) => {
            entity.cubes.push(CubePrimitive { pose, size: Some(vector([width, height, 0.0])), color });
        }
        Form::Box(edges) => entity.cubes.push(CubePrimitive { pose, size: Some(vector(edges)), color }),
        Form::Sphere(radius) => {
            entity.spheres.push(SpherePrimitive { pose, size: Some(vector([2.0 * radius; 3])), color });
        }
        Form::Capsule { radius, length } => {
            let size = Some(vector([2.0 * radius, 2.0 * radius, length]));
            entity.cylinders.push(CylinderPrimitive { pose, size, bottom_scale: 1.0, top_scale: 1.0, color });
            for end in [-0.5, 0.5] {
                let position = along_z(solid, end * length);
                let pose =
                    Some(Pose { position: Some(vector(position)), orientation: Some(quaternion(solid.rotation)) });
                entity.spheres.push(SpherePrimitive { pose, size: Some(vector([2.0 * radius; 3])), color });
            }
        }
    }
    entity
}

fn along_z(solid: &Solid, distance: f64) -> [f64; 3] {
    let [w, x, y, z] = solid.rotation;
    let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    std::array::from_fn(|at| solid.position[at] + distance * axis[at])
}
