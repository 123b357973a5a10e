// Reads the JSON schemas of parameters, so that any kind of effect gets controls without code for it.

/** Returns `{ kind }` of the value that a schema describes, with what its control needs. */
export function shape(schema) {
  if (schema.enum) return { kind: 'choice', values: schema.enum };
  if ('const' in schema) return { kind: 'choice', values: [schema.const] };
  for (const key of ['oneOf', 'anyOf']) {
    if (!schema[key]) continue;
    const shapes = schema[key].map(shape);
    return shapes.every((one) => one.kind === 'choice')
      ? { kind: 'choice', values: shapes.flatMap((one) => one.values) }
      : { kind: 'variants', variants: schema[key] };
  }
  const type = [schema.type].flat().find((type) => type !== 'null') ?? 'null';
  switch (type) {
    case 'number':
    case 'integer':
      return {
        kind: 'number',
        whole: type === 'integer',
        least: schema.minimum ?? schema.exclusiveMinimum ?? -Infinity,
        most: schema.maximum ?? schema.exclusiveMaximum ?? Infinity,
      };
    case 'boolean': return { kind: 'flag' };
    case 'string': return { kind: 'text' };
    case 'array': return {
      kind: 'list', item: schema.items ?? {}, least: schema.minItems ?? 0, most: schema.maxItems ?? Infinity };
    case 'object': return schema.properties
      ? { kind: 'group', properties: schema.properties } : { kind: 'unknown' };
    default: return { kind: type };
  }
}

export const mayBeAbsent = (schema) => Array.isArray(schema.type) && schema.type.includes('null');

/** Returns whether a value has the type of a schema. The server checks the ranges. */
export function fits(schema, value) {
  const s = shape(schema);
  switch (s.kind) {
    case 'number': return typeof value === 'number';
    case 'flag': return typeof value === 'boolean';
    case 'text': return typeof value === 'string';
    case 'null': return value === null;
    case 'choice': return s.values.includes(value);
    case 'list': return Array.isArray(value) && value.length >= s.least && value.length <= s.most
      && value.every((part) => fits(s.item, part));
    case 'group': return value !== null && typeof value === 'object' && !Array.isArray(value);
    case 'variants': return s.variants.some((variant) => fits(variant, value));
    default: return false;
  }
}

/** The mean of a number, of a list, or of the diagonal of a matrix. */
function mean(value) {
  if (!Array.isArray(value)) return typeof value === 'number' ? value : 0;
  const parts = value.map((part, i) => (Array.isArray(part) ? part[i] : part));
  return parts.reduce((sum, part) => sum + part, 0) / parts.length || 0;
}

/** Converts a value to the type of a schema: its default, or the nearest value of this type. */
export function converted(schema, value) {
  if (fits(schema, value)) return value;
  if (schema.default !== undefined && schema.default !== null) return schema.default;
  const s = shape(schema);
  switch (s.kind) {
    case 'number': {
      const x = Math.min(s.most, Math.max(s.least, mean(value)));
      return s.whole ? Math.round(x) : x;
    }
    case 'flag': return false;
    case 'text': return '';
    case 'choice': return s.values[0];
    case 'list': {
      const inner = shape(s.item);
      const square = inner.kind === 'list' && inner.least === s.least;
      return Array.from({ length: s.least }, (_, i) => {
        if (typeof value !== 'number') return converted(s.item, value?.[i] ?? null);
        if (!square) return converted(s.item, value);
        return Array.from({ length: s.least }, (_, j) => (i === j ? value : 0));
      });
    }
    case 'group': return Object.fromEntries(
      Object.entries(s.properties).map(([key, part]) => [key, converted(part, value?.[key] ?? null)]));
    case 'variants': return converted(s.variants[0], value);
    default: return null;
  }
}

/** Returns what the numbers of a list are called, such as w, x, y and z, if its schema says so. */
export function heads(schema) {
  const said = `${schema.description ?? ''} ${schema.legal ?? ''}`.match(/\[(\w(?:,\s+\w)+)\]/);
  return said ? said[1].split(/,\s+/) : [];
}

/** Returns description, unit, range and default of a parameter, for people. */
export function explain(schema) {
  const s = shape(schema);
  const range = s.kind === 'number' && (Number.isFinite(s.least) || Number.isFinite(s.most))
    ? `range: ${s.least} to ${s.most}` : '';
  return [schema.description, schema.unit && `unit: ${schema.unit}`, range,
    schema.legal && `legal: ${schema.legal}`,
    schema.default !== undefined && `default: ${JSON.stringify(schema.default)}`]
    .filter(Boolean).join('\n');
}
