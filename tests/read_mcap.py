"""Reads an MCAP file whose writer may have been killed, as a stranger would: with the mcap package alone, by its end.

Prints one JSON document: what each channel holds, its fields as the schema has them, from when to when (ns since 1970), the last state, the metadata.
"""
import json
import sys

from mcap.reader import make_reader

topics, state = {}, None
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    indexed = reader.get_summary() is not None
    for schema, channel, message in reader.iter_messages():
        topic = topics.setdefault(channel.topic, {
            "schema": schema.name, "fields": json.loads(schema.data)["properties"], "messages": 0, "first_ns": message.log_time})
        topic["messages"] += 1
        topic["last_ns"] = message.log_time
        content = json.loads(message.data)
        if schema.name == "kort.state/1" and "setpoint" in content:
            state = content
    about = {record.name: record.metadata for record in reader.iter_metadata()}
print(json.dumps({"topics": topics, "about": about, "state": state, "indexed": indexed}))
