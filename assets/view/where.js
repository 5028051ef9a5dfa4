// Conditions that a copy can evaluate: comparisons of list columns, joined by `and`, `or` and brackets.
// Without `not`, undefined and false are equivalent: the episode is left out.

const TOKEN = /\s*(?:([A-Za-z_]\w*)|"((?:[^"]|"")+)"|'((?:[^']|'')*)'|(-?\d+(?:\.\d+)?)(?![\w.])|(<>|!=|<=|>=|[=<>(),]))/y;
const HOLDS = { "=": (order) => order === 0, "<>": (order) => order !== 0, "!=": (order) => order !== 0, "<": (order) => order < 0, "<=": (order) => order <= 0, ">": (order) => order > 0, ">=": (order) => order >= 0 };

/** Compares two decimals exactly: negative, 0 or positive. Numbers of JavaScript would round large ones. */
export function compareNumbers(a, b) {
  const parts = [a, b].map((text) => String(text).split("."));
  const places = Math.max(...parts.map(([, part = ""]) => part.length));
  const [left, right] = parts.map(([whole, part = ""]) => BigInt(whole + part.padEnd(places, "0")));
  return left === right ? 0 : left < right ? -1 : 1;
}

function tokens(text) {
  const found = [];
  TOKEN.lastIndex = 0;
  while (text.slice(TOKEN.lastIndex).trim() !== "") {
    const match = TOKEN.exec(text);
    if (match === null) throw new Error("unreadable");
    const [, word, name, string, number, sign] = match;
    if (word !== undefined) found.push({ word: word.toLowerCase(), name: word });
    else if (name !== undefined) found.push({ name: name.replaceAll('""', '"') });
    else if (string !== undefined) found.push({ value: string.replaceAll("''", "'") });
    else if (number !== undefined) found.push({ number });
    else found.push({ word: sign });
  }
  return found;
}

/** Compiles a condition to a predicate on rows; `columns` has an accessor per name. Throws for other conditions. */
function condition(text, columns) {
  const left = tokens(text);
  const take = (word) => left[0]?.word === word && left.shift() !== undefined;
  const need = (is) => {
    if (!is) throw new Error("unknown");
  };
  const either = () => {
    const parts = [both()];
    while (take("or")) parts.push(both());
    return (row) => parts.some((part) => part(row));
  };
  const both = () => {
    const parts = [atom()];
    while (take("and")) parts.push(atom());
    return (row) => parts.every((part) => part(row));
  };
  const atom = () => {
    if (take("(")) {
      const inside = either();
      need(take(")"));
      return inside;
    }
    const { kind, of } = columns.get(left.shift()?.name) ?? {};
    need(of !== undefined);
    const literal = () => {
      const { value, number, word } = left.shift() ?? {};
      // Labels are text in the list, numbers too; a coder's label is true or false.
      const own = kind === "coded" ? ["true", "false"].find((truth) => truth === word) : kind === "number" ? number : kind === "label" ? (value ?? number) : value;
      need(own !== undefined);
      return own;
    };
    const orderOf = kind === "number" ? compareNumbers : (a, b) => (a === b ? 0 : 1);
    if (kind === "coded" && !["is", "in", "=", "<>", "!="].includes(left[0]?.word)) return (row) => of(row) === "true";
    if (take("is")) {
      const isNull = !take("not");
      need(take("null"));
      return (row) => (of(row) === null) === isNull;
    }
    if (take("in")) {
      need(take("("));
      const wanted = [literal()];
      while (take(",")) wanted.push(literal());
      need(take(")"));
      return (row) => of(row) !== null && wanted.some((value) => orderOf(of(row), value) === 0);
    }
    const sign = left.shift()?.word;
    // Only the program knows the order of texts.
    need(Object.hasOwn(HOLDS, sign ?? "") && (kind === "number" || !/^[<>]=?$/.test(sign)));
    const value = literal();
    return (row) => of(row) !== null && HOLDS[sign](orderOf(of(row), value));
  };
  const whole = either();
  need(left.length === 0);
  return whole;
}

function columnsOfList(list) {
  const columns = new Map([["episode_id", { kind: "text", of: (row) => row.id }]]);
  for (const name of ["experiment", "model", "condition"]) columns.set(name, { kind: "text", of: (row) => (row.keys ?? row)[name] });
  for (const name of ["seed", "run"]) columns.set(name, { kind: "number", of: (row) => row[name] });
  for (const name of list.labels ?? []) if (!columns.has(name)) columns.set(name, { kind: name.startsWith("label_") ? "coded" : "label", of: (row) => row.labels[name] ?? null });
  list.metrics.forEach((name, at) => columns.set(name, { kind: "number", of: (row) => row.values[at] }));
  return columns;
}

/** The condition of a link, as a predicate on the rows of a copy's list. */
export function whereOf(text, list) {
  if (text === null || text.trim() === "") return () => true;
  const columns = columnsOfList(list);
  try {
    return condition(text, columns);
  } catch {
    throw new Error(`This copy of the page cannot filter by\n  ${text}\nSo no episode is shown. It compares ${[...columns.keys()].join(", ")} with values, joined by and, or and brackets;\n\`mirrorstats view\` of the recordings takes any condition.`);
  }
}
