"""Reads a recording with the `mcap` package and prints its contents as one JSON object.

Of Fringeflow it knows only the names of topics: schemas come from the file.
"""

import hashlib
import json
import sys

import numpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

# Foxglove's numeric types: UINT8 to FLOAT64.
SCALARS = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def points(cloud):
    """Returns the points of a foxglove.PointCloud as a structured array."""
    record = numpy.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [SCALARS[field.type] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    return numpy.frombuffer(cloud.data, record)


def values(topic, message):
    """Returns the values of a message that the test compares."""
    if topic.endswith("/frame"):
        return [message.width, message.height, message.step, message.encoding, sha256(message.data)]
    if topic == "/cloud":
        cloud = points(message)
        return [len(cloud), [float(cloud[name].astype("f8").sum()) for name in cloud.dtype.names]]
    if topic == "/cloud/header":
        return [message.points, list(message.window.cam1_sequence), message.delta_sd_rad]
    if topic.endswith("/header"):
        return [message.sequence, message.exposure_start_ns, message.camera]
    if topic == "/projector/pattern":
        return [message.sequence, message.step, message.steps, message.period_px]
    if topic == "/report/stage":
        return [message.stage, message.taken, dict(message.dropped)]
    if topic == "/log":
        return [message.name, message.message]
    if topic == "/tf":
        return [transform.child_frame_id for transform in message.transforms]
    return None


def read(path):
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        topics = {}
        for _, channel, record, message in reader.iter_decoded_messages():
            entry = [record.log_time, record.sequence, values(channel.topic, message)]
            topics.setdefault(channel.topic, []).append(entry)
        return {
            "topics": topics,
            "attachments": {a.name: sha256(a.data) for a in reader.iter_attachments()},
            "metadata": {m.name: m.metadata for m in reader.iter_metadata()},
            "counted": reader.get_summary().statistics.message_count,
        }


if __name__ == "__main__":
    json.dump(read(sys.argv[1]), sys.stdout)
