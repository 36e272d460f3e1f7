"""The readers that Foxglove itself uses, in JavaScript: needs node and npm."""

import shutil

JAVASCRIPT = """
const { McapIndexedReader } = require('@mcap/core');
const { loadDecompressHandlers } = require('@mcap/support');
const { parse } = require('@foxglove/rosmsg');
const { MessageReader } = require('@foxglove/rosmsg2-serialization');
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[2]));
const value = {
  '/joint_states': (m) => Array.from(m.position),
  '/simulator/energy': (m) => m.data,
  '/simulator/reactions': (m) => m.wrench[1].force.y,
  '/simulator/scene': (m) => m.data,
  '/diagnostics': (m) => m.status[0].values[0].value,
  '/clock': (m) => m.clock.sec,
};
(async () => {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
  };
  const decompressHandlers = await loadDecompressHandlers();
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const decoders = new Map();
  const text = new TextDecoder();
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    if (!decoders.has(channel.id)) {
      const schema = text.decode(reader.schemasById.get(channel.schemaId).data);
      decoders.set(channel.id, new MessageReader(parse(schema, { ros2: true })));
    }
    const read = decoders.get(channel.id).readMessage(message.data);
    const of = value[channel.topic] || (() => null);
    const seen = [channel.topic, Number(message.logTime), of(read)];
    console.log(JSON.stringify(seen));
  }
})();
"""


NODE = shutil.which('node') and shutil.which('npm')
PACKAGES = (
    '@mcap/core@2',
    '@mcap/support@1',
    '@foxglove/rosmsg@5',
    '@foxglove/rosmsg2-serialization@3',
)
