"""Reads an MCAP file that may have lost its end, as a stranger would: with the mcap package alone.

Prints one JSON document: what each channel holds, from when to when (ns since 1970), the last state, the metadata.
"""
import json
import sys

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

topics, schemas, channels, about, state, end = {}, {}, {}, {}, None, "whole"
with open(sys.argv[1], "rb") as file:
    try:
        for record in StreamReader(file, record_size_limit=None).records:
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Metadata):
                about[record.name] = record.metadata
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                topic = topics.setdefault(channel.topic, {
                    "schema": schemas.get(channel.schema_id), "messages": 0, "first_ns": record.log_time})
                topic["messages"] += 1
                topic["last_ns"] = record.log_time
                content = json.loads(record.data)
                if topic["schema"] == "kort.state/1" and "setpoint" in content:
                    state = content
    except (McapError, EOFError) as error:
        end = type(error).__name__
print(json.dumps({"topics": topics, "about": about, "state": state, "end": end}))
