"""Reads logs with MCAP's and Foxglove's own Python packages and checks what `mcap doctor` does, and their schemas.

Usage: check-log.py LOG.mcap...

Checked are: magic bytes, every checksum, that schemas and channels come before what uses them, the order and the times of
messages, message indexes, chunk indexes, metadata indexes, summary offsets, statistics, footer; that each topic has the
schema that a viewer expects, that Foxglove's schemas are Foxglove's, and that every message is one of its schema.
"""

import collections
import importlib
import io
import json
import struct
import sys
import zlib

import jsonschema
from google.protobuf import descriptor_pb2
from mcap import records as kinds
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream
from mcap_protobuf.decoder import DecoderFactory as Protobuf

TOPICS = {
    "/episode": ("mirrorstats.Episode", "jsonschema", "json"),
    "/camera": ("foxglove.CompressedImage", "protobuf", "protobuf"),
    "/tf": ("foxglove.FrameTransforms", "protobuf", "protobuf"),
    "/scene": ("foxglove.SceneUpdate", "protobuf", "protobuf"),
    "/census": ("mirrorstats.Census", "jsonschema", "json"),
    "/decision": ("mirrorstats.Decision", "jsonschema", "json"),
}
MAGIC = b"\x89MCAP0\r\n"


class Fault(Exception):
    """What is wrong with a log."""


def expect(what, found, expected):
    if found != expected:
        raise Fault(f"{what}: expected {expected!r}, found {found!r}")


def framed(data, start, end):
    """The records of these bytes: where each begins, its opcode and its length with its frame."""
    while start < end:
        opcode, length = struct.unpack_from("<BQ", data, start)
        yield start, opcode, 9 + length
        start += 9 + length
    expect("the end of the last record", start, end)


class Log:
    """A log, its records in order and where each begins."""

    def __init__(self, path):
        with open(path, "rb") as file:
            self.data = file.read()
        expect("the first and the last bytes", (self.data[:8], self.data[-8:]), (MAGIC, MAGIC))
        self.places = list(framed(self.data, 8, len(self.data) - 8))
        # Strict: the package checks the data's and every chunk's checksum while it reads.
        reader = StreamReader(io.BytesIO(self.data), emit_chunks=True, validate_crcs=True)
        self.records = list(reader.records)
        expect("the number of records", len(self.records), len(self.places))
        self.schemas, self.channels = {}, {}
        self.messages = collections.Counter()
        self.times = []

    def of(self, kind):
        return [(record, place) for record, place in zip(self.records, self.places) if isinstance(record, kind)]

    def check(self):
        expect("the first record", type(self.records[0]), kinds.Header)
        expect("the profile", self.records[0].profile, "")
        expect("the library", self.records[0].library.split(" ")[0], "mirrorstats")
        expect("messages outside chunks", len(self.of(kinds.Message)), 0)
        indexes = collections.deque()
        for at, record in enumerate(self.records):
            if isinstance(record, kinds.Chunk):
                indexes.append(self.check_chunk(at, record))
            elif isinstance(record, kinds.DataEnd):
                break
        self.check_summary(list(indexes))
        # A log without frames has no channel for them.
        expect("the topics", {c.topic for c in self.channels.values()} | {"/camera"}, set(TOPICS))

    def check_chunk(self, at, chunk):
        """Checks a chunk and the message indexes behind it; gives what its chunk index must say."""
        breakup_chunk(chunk, validate_crc=True)
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        content = stream.read(size)
        expect("the uncompressed size", len(content), chunk.uncompressed_size)
        found = collections.defaultdict(list)
        times = []
        for offset, opcode, length in framed(content, 0, len(content)):
            inner = StreamReader(io.BytesIO(content[offset : offset + length]), skip_magic=True)
            record = next(inner.records)
            if isinstance(record, kinds.Schema):
                self.add("schema", self.schemas, record)
            elif isinstance(record, kinds.Channel):
                expect(f"the schema of {record.topic} is known", record.schema_id in self.schemas, True)
                self.add("channel", self.channels, record)
            elif isinstance(record, kinds.Message):
                self.check_message(record)
                found[record.channel_id].append((record.log_time, offset))
                times.append(record.log_time)
            else:
                raise Fault(f"a record {Opcode(opcode)} in a chunk")
        expect("the times of a chunk", (chunk.message_start_time, chunk.message_end_time), (min(times), max(times)))
        self.times += times
        offsets = {}
        length = 0
        for record, (place, _, whole) in zip(self.records[at + 1 :], self.places[at + 1 :]):
            if not isinstance(record, kinds.MessageIndex):
                break
            expect(f"the message index of {record.channel_id}", sorted(record.records), sorted(found[record.channel_id]))
            offsets[record.channel_id] = place
            length += whole
        expect("the channels with a message index", set(offsets), set(found))
        place, _, whole = self.places[at]
        return (place, whole, chunk.compression, len(chunk.data), min(times), max(times), length, offsets, len(content))

    def add(self, what, known, record):
        if record.id == 0 or known.setdefault(record.id, record) != record:
            raise Fault(f"the {what} {record.id} is another than before")

    def check_message(self, message):
        channel = self.channels.get(message.channel_id)
        if channel is None:
            raise Fault(f"a message of the channel {message.channel_id}, which is not known")
        self.messages[message.channel_id] += 1
        schema = self.schemas[channel.schema_id]
        if schema.encoding == "jsonschema":
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))
            return
        decoder = Protobuf().decoder_for(channel.message_encoding, schema)
        decoded = decoder(message.data)
        expect(f"a message of {channel.topic} written anew", len(decoded.SerializeToString()), len(message.data))
        if channel.topic == "/camera":
            expect("the format of a frame", (decoded.format, decoded.data[:8]), ("png", b"\x89PNG\r\n\x1a\n"))

    def check_summary(self, indexes):
        expect("that messages are in order of time", self.times, sorted(self.times))
        found = [(i.chunk_start_offset, i.chunk_length, i.compression, i.compressed_size, i.message_start_time,
                  i.message_end_time, i.message_index_length, i.message_index_offsets, i.uncompressed_size)
                 for i, _ in self.of(kinds.ChunkIndex)]
        expect("the chunk indexes", found, indexes)
        metadata = [(place, length, record.name) for record, (place, _, length) in self.of(kinds.Metadata)]
        expect("the metadata indexes", [(i.offset, i.length, i.name) for i, _ in self.of(kinds.MetadataIndex)], metadata)
        expect("the metadata", [name for _, _, name in metadata], ["mirrorstats.recording"])
        [(statistics, _)] = self.of(kinds.Statistics)
        counted = (sum(self.messages.values()), len(self.schemas), len(self.channels), 0, len(metadata), len(indexes),
                   min(self.times), max(self.times), dict(self.messages))
        expect("the statistics", (statistics.message_count, statistics.schema_count, statistics.channel_count,
               statistics.attachment_count, statistics.metadata_count, statistics.chunk_count,
               statistics.message_start_time, statistics.message_end_time, statistics.channel_message_counts), counted)
        expect("the schemas of the summary", {s.id: s for s, _ in self.of(kinds.Schema)}, self.schemas)
        expect("the channels of the summary", {c.id: c for c, _ in self.of(kinds.Channel)}, self.channels)
        [(footer, (place, _, _))] = self.of(kinds.Footer)
        [(_, (end, _, length))] = self.of(kinds.DataEnd)
        expect("where the summary begins", footer.summary_start, end + length)
        expect("the checksum of the summary", zlib.crc32(self.data[footer.summary_start : place + 9 + 16]), footer.summary_crc)
        self.check_offsets(footer, place)

    def check_offsets(self, footer, end):
        """Each group of the summary is where its offset says, and no group is without one."""
        groups = {}
        for place, opcode, length in self.places:
            if footer.summary_start <= place < footer.summary_offset_start:
                start, total = groups.get(opcode, (place, 0))
                groups[opcode] = (start, total + length)
        offsets = {o.group_opcode: (o.group_start, o.group_length) for o, _ in self.of(kinds.SummaryOffset)}
        expect("the summary offsets", offsets, groups)

    def check_schemas(self):
        for channel in self.channels.values():
            schema = self.schemas[channel.schema_id]
            found = (schema.name, schema.encoding, channel.message_encoding)
            expect(f"the schema of {channel.topic}", found, TOPICS[channel.topic])
            if schema.encoding == "jsonschema":
                jsonschema.Draft202012Validator.check_schema(json.loads(schema.data))
            else:
                check_descriptor(schema)


def shape(message):
    return sorted((field.number, field.name, field.type, field.label, field.type_name) for field in message.field)


def check_descriptor(schema):
    """A schema and all that it refers to, field for field as in Foxglove's own package."""
    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    found = {f"{file.package}.{message.name}": message for file in files.file for message in file.message_type}
    expect(f"that {schema.name} is described", schema.name in found, True)
    for name, message in found.items():
        if name.startswith("foxglove."):
            own = descriptor_pb2.DescriptorProto()
            module = importlib.import_module(f"foxglove_schemas_protobuf.{message.name}_pb2")
            getattr(module, message.name).DESCRIPTOR.CopyToProto(own)
            expect(f"the fields of {name}", shape(message), shape(own))


def main():
    for path in sys.argv[1:]:
        try:
            log = Log(path)
            log.check()
            log.check_schemas()
        except Fault as fault:
            sys.exit(f"{path}: {fault}")
        messages = sum(log.messages.values())
        print(f"{path.rsplit('/', 1)[-1]}: {messages} messages in {len(log.of(kinds.Chunk))} chunks, nothing to find")


if __name__ == "__main__":
    main()
