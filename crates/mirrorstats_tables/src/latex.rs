//! Tables as LaTeX: booktabs, in the paper's layout.

use std::fmt::Write as _;

use super::{Align, Column, DAGGER, Emphasis, Look, RowGroup, Table, TableCell};
use mirrorstats_exact::escape::visible;
use mirrorstats_metric::catalogs::catalog::Better;

const PACKAGES: &str = "% Needs in the preamble: \\usepackage{booktabs}, \\usepackage{graphicx}";
/// The package for the shaded headings of groups.
const SHADES: &str = ", \\usepackage[table]{xcolor}";

/// Prints the box of the table at its natural width, or at the width of the line if it is wider.
const SHRINK: &str = "\\ifdim\\wd0>\\linewidth\\resizebox{\\linewidth}{!}{\\usebox0}\\else\\usebox0\\fi\n";

/// The characters that fit one of two columns of a page; wider tables span both.
const COLUMN_WIDTH: usize = 46;

/// The characters that may fit a page at the natural size. Wider tables are the paper's own form, shrunk to the page.
const PAGE_WIDTH: usize = 92;

/// Takes characters and their codes. `XeTeX` and `LuaTeX` print the characters; pdfTeX prints the codes, unless the preamble
/// has its own definition and the packages for the script.
const UNICODE: &str = "\\providecommand{\\mirrorstatstext}[2]{\\ifdefined\\Umathchar#1\\else#2\\fi}\n";

/// Characters outside ASCII that pdfTeX prints in OT1 and T1 without a package.
const PRINTED: &str = "‘’“”•…€‰™ȘșȚț";
/// Those of Latin-1 and Latin Extended-A that it does not.
const UNPRINTED: &str = "«»ÐÞðþĄąĐđĘęĦħĮįĸĿŀŉŊŋŦŧŲų";

/// Those of both that the typewriter font replaces in OT1: it has other signs in their places, and in those of accents.
const ROMAN: &str = "“”¡¿ŁłŐőŰűĊċĖėĠġİŻż";

/// Characters that are commands of TeX's mathematics.
const MATHEMATICS: &str = "α alpha β beta γ gamma δ delta ε varepsilon ζ zeta η eta θ theta ι iota κ kappa λ lambda \
    μ mu ν nu ξ xi ο o π pi ρ rho ς varsigma σ sigma τ tau υ upsilon φ varphi χ chi ψ psi ω omega Γ Gamma Δ Delta \
    Θ Theta Λ Lambda Ξ Xi Π Pi Σ Sigma Υ Upsilon Φ Phi Ψ Psi Ω Omega ← leftarrow → rightarrow ↑ uparrow ↓ downarrow \
    ≤ le ≥ ge ≠ neq ≈ approx ∞ infty − - ∈ in ∑ sum √ surd";

impl Table {
    /// As LaTeX; its first line names the packages that it needs.
    pub fn latex(&self) -> String {
        let is_sheet = self.look == Look::Sheet;
        let (shades, blank) = if is_sheet { (SHADES, "\n") } else { ("", "") };
        let columns: String = self.columns.iter().map(|c| if c.align == Align::Left { 'l' } else { 'c' }).collect();
        let header = line(self.columns.iter().map(|column| header(column, is_sheet)));
        let (environment, open, close) = match self.width() {
            width if width <= COLUMN_WIDTH => ("table", "\\sbox0", SHRINK),
            width if width <= PAGE_WIDTH => ("table*", "\\sbox0", SHRINK),
            _ => ("table*", "\\resizebox{\\textwidth}{!}", ""),
        };
        let mut text = format!(
            "\\begin{{{environment}}}[t]\n\\centering\n{open}{{%\n\\begin{{tabular}}{{{columns}}}\n\\toprule\n{header}"
        );
        for (at, group) in self.groups.iter().enumerate() {
            if at == 0 || group.heading.is_some() {
                let (before, after) = if at == 0 { ("", blank) } else { (blank, "") };
                let _ = write!(text, "{before}\\midrule\n{after}");
            }
            push_group(&mut text, group, self);
        }
        let _ = writeln!(text, "{blank}\\bottomrule\n\\end{{tabular}}%\n}}\n{close}\\caption{{{}}}", caption(self));
        if let Some(label) = &self.label {
            let _ = writeln!(text, "\\label{{{}}}", identifier(label));
        }
        let _ = writeln!(text, "\\end{{{environment}}}");
        let command = if text.contains("\\mirrorstatstext{") { UNICODE } else { "" };
        format!("{PACKAGES}{shades}\n{command}{text}")
    }

    /// The characters of a line, with two between columns.
    fn width(&self) -> usize {
        let cell = |cell: &TableCell| {
            let detail = cell.detail.as_ref().map_or(0, |detail| 1 + detail.chars().count());
            cell.text.chars().count() + detail
        };
        let column = |(at, column): (usize, &Column)| {
            let cells = self.rows().filter_map(|row| row.get(at)).map(cell);
            cells.chain([column.heading.chars().count()]).max().unwrap_or(0) + 2
        };
        self.columns.iter().enumerate().map(column).sum()
    }
}

/// A line of cells. The command that ends the line before takes `[` and `*` for its own arguments.
fn line(cells: impl Iterator<Item = String>) -> String {
    let cells = cells.collect::<Vec<_>>().join(" & ");
    let guard = if cells.trim_start().starts_with(['[', '*']) { "{}" } else { "" };
    format!("{guard}{cells} \\\\\n")
}

fn header(column: &Column, is_sheet: bool) -> String {
    let arrow = match column.better {
        Better::Higher => " $\\uparrow$",
        Better::Lower => " $\\downarrow$",
        Better::Neither => "",
    };
    if is_sheet { format!("\\textbf{{{}}}{arrow}", column_name(column)) } else { column_name(column) }
}

fn column_name(column: &Column) -> String {
    column.latex.clone().unwrap_or_else(|| escape(&column.heading))
}

fn push_group(text: &mut String, group: &RowGroup, table: &Table) {
    if let Some(heading) = &group.heading {
        let (width, heading) = (table.columns.len(), escape(heading));
        let _ = write!(
            text,
            "\\rowcolor{{gray!15}}\n\\multicolumn{{{width}}}{{c}}{{\\textbf{{{heading}}}}} \\\\\n\\midrule\n"
        );
    }
    for row in &group.rows {
        *text += &line(row.iter().enumerate().map(|(at, cell)| match (at < table.names, table.look) {
            (true, Look::Sheet) => format!("\\texttt{{{}}}", escape(&cell.text).replace("--", "\\textrm{--}")),
            (true, _) => escape(&cell.text),
            (false, _) => value(cell),
        }));
    }
}

fn value(cell: &TableCell) -> String {
    if !cell.is_number {
        return if is_dash(&cell.text) { cell.text.clone() } else { escape(&cell.text) };
    }
    let mark = if cell.is_marked { "$^{\\dagger}$" } else { "" };
    let math = |body: &str| match cell.emphasis {
        Emphasis::Plain => format!("${body}$"),
        Emphasis::Bold => format!("$\\mathbf{{{body}}}$"),
        Emphasis::Underline => format!("$\\underline{{{body}}}$"),
    };
    match &cell.detail {
        None => format!("{}{mark}", math(&cell.text)),
        Some(detail) if cell.is_whole => {
            format!("{}{mark}", math(&format!("{} {}", cell.text, detail.replace('±', "\\pm"))))
        }
        // A hyphen before a digit is a minus sign only in math mode.
        Some(detail) => format!("{}{mark} {}", math(&cell.text), detail.replace('-', "$-$")),
    }
}

fn caption(table: &Table) -> String {
    let title = escape(&table.title);
    let mut caption = match table.look {
        Look::Sheet => format!("\\textbf{{{title}}}."),
        Look::Plain | Look::Ruled | Look::Framed => format!("\\textbf{{{title}.}}"),
    };
    for sentence in &table.sentences {
        caption.push(' ');
        caption.push_str(&prose(sentence, &table.columns[table.names..]));
    }
    caption
}

/// A sentence, in which names of columns look as in the header.
fn prose(text: &str, columns: &[Column]) -> String {
    let text = visible(text);
    let (mut latex, mut start, mut at) = (String::new(), 0, 0);
    for part in text.split_inclusive(|c: char| !is_word(c)) {
        let word = part.trim_end_matches(|c| !is_word(c));
        let column = columns.iter().find(|column| column.heading == word).map(column_name);
        if let Some(word_latex) = column.or_else(|| is_dash(word).then(|| word.to_owned())) {
            push_escaped(&mut latex, &text[start..at]);
            latex += &word_latex;
            start = at + word.len();
        }
        at += part.len();
    }
    push_escaped(&mut latex, &text[start..]);
    latex
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '-'
}

/// True for a placeholder of a missing value, and for a dash in a sentence.
fn is_dash(word: &str) -> bool {
    matches!(word, "--" | "---")
}

/// A label without characters that would end it or start a command.
fn identifier(label: &str) -> String {
    label.chars().filter(|c| c.is_alphanumeric() || ":-_.".contains(*c)).collect()
}

/// Escaped text that prints unchanged in the font encodings OT1 and T1.
fn escape(text: &str) -> String {
    let text = visible(text);
    let inner = text.trim_matches(' ');
    let leading = text.len() - text.trim_start_matches(' ').len();
    let mut latex = SPACE.repeat(leading);
    push_escaped(&mut latex, inner);
    latex + &SPACE.repeat(text.len() - inner.len() - leading)
}

/// A space that TeX keeps at the edge of a cell and beside another space.
const SPACE: &str = "\\mbox{ }";

fn push_escaped(latex: &mut String, visible: &str) {
    let mut before = None;
    let mut rest = visible;
    while let Some(c) = rest.chars().next() {
        let foreign = rest.find(|c| !is_foreign(c)).unwrap_or(rest.len());
        let (part, behind) = rest.split_at(foreign.max(c.len_utf8()));
        match c {
            _ if foreign > 0 => push_foreign(latex, part),
            ' ' if before == Some(' ') => latex.push_str(SPACE),
            _ if before.is_some_and(|before| is_ligature(before, c)) => {
                latex.push_str("{}");
                push_character(latex, c);
            }
            _ => push_character(latex, c),
        }
        (before, rest) = (Some(c), behind);
    }
}

/// Returns true if TeX makes another sign of the two, such as a dash of hyphens.
fn is_ligature(before: char, c: char) -> bool {
    let is_dash = |c| matches!(c, '-' | '–');
    is_dash(before) && is_dash(c) || before == c && matches!(c, '\'' | ',')
}

fn push_character(latex: &mut String, c: char) {
    match c {
        '\\' => latex.push_str("\\textbackslash{}"),
        '^' => latex.push_str("\\textasciicircum{}"),
        '~' => latex.push_str("\\textasciitilde{}"),
        '<' => latex.push_str("\\textless{}"),
        '>' => latex.push_str("\\textgreater{}"),
        '|' => latex.push_str("\\textbar{}"),
        // In OT1, only the typewriter font has this sign.
        '"' => latex.push_str("{\\ttfamily\\char34}"),
        '`' => latex.push_str("\\textasciigrave{}"),
        '{' | '}' | '_' | '&' | '%' | '$' | '#' => latex.extend(['\\', c]),
        '\u{a0}' => latex.push_str(SPACE),
        '–' => latex.push_str("--"),
        '—' => latex.push_str("\\textrm{\\textemdash}"),
        '±' => latex.push_str("$\\pm$"),
        DAGGER => latex.push_str("$^{\\dagger}$"),
        other => match mathematics(other) {
            Some("o") => latex.push_str("$o$"),
            Some("-") => latex.push_str("$-$"),
            Some(command) => latex.extend(["$\\", command, "$"]),
            None if ROMAN.contains(other) => latex.extend(["\\textrm{", other.encode_utf8(&mut [0; 4]), "}"]),
            None => latex.push(other),
        },
    }
}

fn mathematics(c: char) -> Option<&'static str> {
    let mut words = MATHEMATICS.split_whitespace();
    words.find(|word| word.chars().eq([c]) && !c.is_ascii())?;
    words.next()
}

/// Returns true if pdfTeX cannot print the character.
fn is_foreign(c: char) -> bool {
    let is_printed = c.is_ascii() || matches!(c, '\u{a0}'..='ž') && !UNPRINTED.contains(c);
    !(is_printed || matches!(c, '–' | '—' | DAGGER) || PRINTED.contains(c) || mathematics(c).is_some())
}

fn push_foreign(latex: &mut String, characters: &str) {
    let codes = characters
        .chars()
        .fold(String::new(), |codes, c| codes + &format!("\\textbackslash{{}}u\\{{{:x}\\}}", u32::from(c)));
    latex.extend(["\\mirrorstatstext{", characters, "}{", &codes, "}"]);
}

#[cfg(test)]
mod tests {
    use super::escape;

    #[test]
    fn commands_in_names_are_escaped() {
        for (text, expected) in [
            ("GPT 5.1", "GPT 5.1"),
            ("a_b & 50% $x$ #1", "a\\_b \\& 50\\% \\$x\\$ \\#1"),
            ("\\input{/etc/passwd}", "\\textbackslash{}input\\{/etc/passwd\\}"),
            ("x^2~y", "x\\textasciicircum{}2\\textasciitilde{}y"),
            ("Self–other", "Self--other"),
            ("a--b–-c ''c'' ,,d", "a-{}-b--{}-c '{}'c'{}' ,{},d"),
            (" a  b ", "\\mbox{ }a \\mbox{ }b\\mbox{ }"),
            ("  ", "\\mbox{ }\\mbox{ }"),
            ("say \"hi\"", "say {\\ttfamily\\char34}hi{\\ttfamily\\char34}"),
            ("π0 é", "$\\pi$0 é"),
            ("日本 x", "\\mirrorstatstext{日本}{\\textbackslash{}u\\{65e5\\}\\textbackslash{}u\\{672c\\}} x"),
            ("one\n\ntwo", "one\\textbackslash{}u\\{a\\}\\textbackslash{}u\\{a\\}two"),
        ] {
            assert_eq!(escape(text), expected);
        }
    }
}
