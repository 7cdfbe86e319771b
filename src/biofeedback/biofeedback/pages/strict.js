// Messages as the node defines them: whoever reads a field that no message has hears of it on the console.

const RETRY = 500; // ms; a node that restarts is back within seconds
let schemas = {}; // until they are here messages are taken as they come: no key waits for a file, and a stop least of all

async function load() {
  try {
    schemas = await (await fetch("/pages/schemas.json")).json();
  } catch {
    setTimeout(load, RETRY); // the node is away
  }
}
load();

export function typed(message) {
  return wrap(message, schemas[message.type]);
}

function wrap(value, schema) {
  if (value === null || typeof value !== "object" || !schema) return value;
  if (schema.anyOf) return wrap(value, schema.anyOf.find((one) => one.type !== "null"));
  if (schema.type === "array") return schema.items?.properties ? value.map((one) => wrap(one, schema.items)) : value;
  const rest = schema.additionalProperties;
  if (!schema.properties) return rest?.properties ? Object.fromEntries(Object.entries(value).map(([key, one]) => [key, wrap(one, rest)])) : value;
  return new Proxy(value, {
    get(target, key) {
      if (typeof key === "string" && key !== "toJSON" && !(key in schema.properties)) console.error(`message ${schema.title} has no field ${key}`);
      return wrap(target[key], schema.properties[key]);
    },
  });
}
