//! A report as one self-contained web page: text, tables, plots and images in a single file.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::{Machine, mark};

/// An image of a page.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// The name of the file of the image too; its ending, `.svg` or `.png`, is its format.
    pub name: &'a str,
    /// The content of that file.
    pub content: &'a [u8],
    /// What an image shows, as a sentence; a plot has its own description.
    pub caption: Option<&'a str>,
}

/// A page.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    /// The title of the browser's window.
    pub title: &'a str,
    /// The text in Markdown with tables (GitHub's dialect); HTML in it is shown literally.
    pub report: &'a str,
    /// The plots and images, shown before the first section or table of the text.
    pub figures: Vec<Figure<'a>>,
    /// The program and its settings.
    pub settings: &'a Value,
    /// The machine of the measured times.
    pub machine: &'a Machine,
}

/// The policy against loading: a browser that honours it sends no request, and runs no script but [`SCRIPT`].
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src";

/// The number of columns from which a table is printed across the paper.
const MIN_BROAD: usize = 13;

const STYLE: &str = include_str!("page.css");
/// The script that sorts tables; the page is complete without it.
const SCRIPT: &str = include_str!("page.js");

impl Page<'_> {
    /// Returns the page as HTML 5; equal input gives equal bytes.
    ///
    /// It follows the browser's light or dark theme, fits narrow screens (wide tables scroll separately), and prints in black on white.
    #[must_use]
    pub fn to_html(&self) -> String {
        let mut page = String::new();
        let title = escaped(self.title);
        let hash = BASE64_STANDARD.encode(Sha256::digest(SCRIPT));
        // Writing to a String cannot fail.
        let _ = write!(
            page,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY} 'sha256-{hash}'\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n"
        );
        let report = self.report_body();
        let starts = ["<h2>", "<div class=\"wide"].map(|part| report.find(part));
        let start = starts.into_iter().flatten().min().unwrap_or(report.len());
        let (introduction, sections) = report.split_at(start);
        page.push_str(introduction);
        let has_figures = !self.figures.is_empty();
        if has_figures {
            page.push_str("<h2>Figures</h2>\n<p><a href=\"#tables\">Skip to the tables</a></p>\n");
        }
        push_key(&mut page, &self.marks());
        for figure in &self.figures {
            push_figure(&mut page, figure);
        }
        page.push_str("<div id=\"tables\">\n");
        if has_figures && sections.starts_with("<div") {
            page.push_str("<h2>Table</h2>\n");
        }
        page.push_str(sections);
        self.push_origin(&mut page);
        page.push_str("</div>\n");
        let _ = write!(page, "</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n");
        page
    }

    /// Returns the names in the plots, each once with the number of its colour and mark.
    fn marks(&self) -> Vec<(&str, usize)> {
        let mut marks: Vec<(&str, usize)> = Vec::new();
        let plots = self.figures.iter().filter_map(svg);
        for line in plots
            .filter_map(|plot| between(plot, "<metadata>", "</metadata>"))
            .flat_map(str::lines)
        {
            let key = line
                .split_once(' ')
                .and_then(|(style, name)| Some((name, style.parse().ok()?)));
            marks.extend(key.filter(|(name, _)| marks.iter().all(|(known, _)| known != name)));
        }
        marks
    }

    /// Returns the text as HTML.
    ///
    /// Headers of tables are buttons that sort by their column, names of the plots have their marks, and wide tables scroll with the keyboard.
    fn report_body(&self) -> String {
        let marks = self.marks();
        let events = Parser::new_ext(self.report, Options::ENABLE_TABLES);
        // A report is plain text: apparent markup is not meant as such.
        let as_text = events.map(|event| match event {
            Event::Html(text) | Event::InlineHtml(text) => Event::Text(text),
            // The alternative text of an image stays.
            Event::Start(Tag::Image { .. }) | Event::End(TagEnd::Image) => Event::Text("".into()),
            other => other,
        });
        let (mut is_head, mut is_cell, mut is_heading) = (false, false, false);
        let mut heading = String::new();
        let with_marks = as_text.flat_map(|event| {
            match &event {
                Event::Start(Tag::TableHead) => is_head = true,
                Event::End(TagEnd::TableHead) => is_head = false,
                Event::Start(Tag::TableCell) => is_cell = true,
                Event::End(TagEnd::TableCell) => is_cell = false,
                Event::Start(Tag::Heading { .. }) => {
                    is_heading = true;
                    heading.clear();
                }
                Event::End(TagEnd::Heading(_)) => is_heading = false,
                Event::Text(text) | Event::Code(text) if is_heading => heading.push_str(text),
                _ => {}
            }
            let markup = |text: String| Event::InlineHtml(CowStr::from(text));
            let (before, after) = match &event {
                Event::Start(Tag::Table(columns)) => (Some(markup(region(&heading, columns.len()))), None),
                Event::End(TagEnd::Table) => (None, Some(markup("</div>\n".to_owned()))),
                Event::Start(Tag::TableCell) if is_head => (None, Some(markup("<button type=\"button\">".to_owned()))),
                Event::End(TagEnd::TableCell) if is_head => (Some(markup("</button>".to_owned())), None),
                // A setting may follow the name in brackets.
                Event::Text(text) if is_cell => {
                    let name = escaped(text.split(" (").next().unwrap_or_default());
                    let own = marks.iter().find(|(known, _)| *known == name);
                    (own.map(|(_, style)| markup(mark::inline(*style))), None)
                }
                _ => (None, None),
            };
            let shown = match event {
                Event::Text(text) if is_cell && text.contains("e-") => markup(with_powers(&text)),
                other => other,
            };
            before.into_iter().chain([shown]).chain(after)
        });
        let mut body = String::new();
        html::push_html(&mut body, with_marks);
        body.replace("<th ", "<th scope=\"col\" ")
            .replace("<th>", "<th scope=\"col\">")
    }

    /// Adds the program, its settings and the machine.
    fn push_origin(&self, page: &mut String) {
        page.push_str("<h2>How this was made</h2>\n<div class=\"wide\"><table class=\"facts\">\n");
        let mut row = |name: &str, value: &str| {
            let _ = writeln!(
                page,
                "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
                escaped(name),
                escaped(value)
            );
        };
        row("radiosity", env!("CARGO_PKG_VERSION"));
        let machine = self.machine;
        row("processor", machine.processor());
        row("threads", &machine.n_threads.to_string());
        row("system", &format!("{} on {}", machine.system, machine.architecture));
        for (name, value) in self.settings.as_object().into_iter().flatten() {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            row(&name.replace('_', " "), &text);
        }
        page.push_str("</table></div>\n");
    }
}

/// Returns the text of a cell as HTML in which a number stays on one line.
fn with_powers(text: &str) -> String {
    let is_digit = |c: char| c.is_ascii_digit();
    let words = text.split(' ').map(|word| match word.split_once("e-") {
        Some((digits, power)) if digits.ends_with(is_digit) && power.starts_with(is_digit) => {
            format!("<span class=\"power\">{}</span>", escaped(word))
        }
        _ => escaped(word),
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Returns the start of the part that scrolls with a table, named after the heading above.
fn region(heading: &str, n_columns: usize) -> String {
    let class = if n_columns < MIN_BROAD { "wide" } else { "wide broad" };
    let kind = if heading.starts_with("Table") { "" } else { "Table: " };
    let name = escaped(heading);
    format!("<div class=\"{class}\" role=\"region\" aria-label=\"{kind}{name}\" tabindex=\"0\">")
}

/// Adds the list of marks, as a narrow screen does not show the legend of a plot.
fn push_key(page: &mut String, marks: &[(&str, usize)]) {
    if marks.is_empty() {
        return;
    }
    page.push_str("<ul class=\"key\" aria-label=\"marks of the plots\">\n");
    for (name, style) in marks {
        let _ = writeln!(page, "<li>{}{name}</li>", mark::inline(*style));
    }
    page.push_str("</ul>\n");
}

/// Adds a plot as SVG, any other image as data; the style sheet gives plots the page's colours.
fn push_figure(page: &mut String, figure: &Figure<'_>) {
    let name = escaped(figure.name);
    let words = words_of(&name);
    page.push_str("<figure>\n");
    let sentence = if let Some(plot) = svg(figure) {
        let description = between(plot, "<desc>", "</desc>").unwrap_or_default();
        let label = if description.is_empty() { &words } else { description };
        let label = label.replace('"', "&quot;");
        let labelled = format!("<svg role=\"img\" aria-label=\"{label}\"");
        let _ = writeln!(
            page,
            "<div class=\"wide\" role=\"region\" aria-label=\"{label}\" tabindex=\"0\">{}</div>",
            plot.replacen("<svg", &labelled, 1)
        );
        format!("{description} The file is <code>{name}</code>.")
    } else {
        let data = BASE64_STANDARD.encode(figure.content);
        let caption = figure.caption.map(escaped);
        let alt = caption.as_ref().unwrap_or(&words);
        let _ = writeln!(page, "<img alt=\"{alt}\" src=\"data:image/png;base64,{data}\">");
        match &caption {
            Some(caption) => format!("{caption} The file is <code>{name}</code>."),
            None => format!("{words} is the image in <code>{name}</code>."),
        }
    };
    let _ = writeln!(page, "<figcaption>{}</figcaption>\n</figure>", sentence.trim());
}

/// Returns the text of a plot, or `None` for another image.
fn svg<'a>(figure: &Figure<'a>) -> Option<&'a str> {
    let text = std::str::from_utf8(figure.content).ok();
    text.filter(|_| has_ending(figure.name, "svg"))
}

/// Returns the text between the first `start` and the next `end`.
fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(start)?;
    rest.split_once(end).map(|(inner, _)| inner)
}

/// Returns the name of a file in words: without its ending, separated by blanks.
fn words_of(name: &str) -> String {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let words = stem.replace(['-', '_'], " ");
    let mut letters = words.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn has_ending(name: &str, ending: &str) -> bool {
    std::path::Path::new(name)
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn page(report: &str, figures: Vec<Figure<'_>>) -> String {
        let machine = Machine {
            cpu_model: Some("a <processor>".to_owned()),
            n_cores: Some(2),
            n_threads: 2,
            architecture: "some",
            system: "any",
        };
        let settings = json!({"time_limit_s": 10.0, "method": "sr & sg"});
        let page = Page {
            title: "a < b",
            report,
            figures,
            settings: &settings,
            machine: &machine,
        };
        page.to_html()
    }

    #[test]
    fn text_tables_settings_and_machine_are_there() {
        let html = page("# Head\n\n| a | b |\n|---|--:|\n| 1 | x |\n", Vec::new());
        for part in [
            "<title>a &lt; b</title>",
            "<h1>Head</h1>",
            "tabindex=\"0\"><table><thead>",
            "<th scope=\"col\"><button type=\"button\">a</button></th>",
            "<button type=\"button\">b</button></th>",
            "<td>1</td>",
            "a &lt;processor&gt;",
            "<th scope=\"row\">time limit s</th><td>10.0</td>",
            "sr &amp; sg",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        assert!(!html.contains("<h2>Figures"));
    }

    #[test]
    fn figures_come_before_the_sections() {
        let figure = Figure {
            name: "a.png",
            content: b"\x89PNG",
            caption: Some("A \"room\"."),
        };
        let html = page("# Head\n\nFirst words.\n\n## Section\n\nMore.\n", vec![figure]);
        let places = [
            "First words",
            "<h2>Figures</h2>",
            "<figure>",
            "<h2>Section</h2>",
            "How this was made",
        ];
        let places = places.map(|part| html.find(part).unwrap_or_else(|| panic!("{part}: {html}")));
        assert!(places.is_sorted(), "{places:?}");
        assert!(html.contains("<img alt=\"A &quot;room&quot;.\" src"), "{html}");
        assert!(html.contains("<figcaption>A &quot;room&quot;. The file is <code>a.png</code>.</figcaption>"));
    }

    #[test]
    fn figures_come_before_a_table_without_a_section() {
        let figure = Figure {
            name: "a.svg",
            content: b"<svg width=\"1\"></svg>",
            caption: None,
        };
        let html = page("# Head\n\nFirst words.\n\n| a |\n|---|\n| 1 |\n", vec![figure]);
        let places = [
            "First words",
            "<figure>",
            "<div id=\"tables\">",
            "<h2>Table</h2>",
            "<td>1</td>",
        ];
        let places = places.map(|part| html.find(part).unwrap_or_else(|| panic!("{part}: {html}")));
        assert!(places.is_sorted(), "{places:?}");
    }

    #[test]
    fn tables_are_named_after_their_headings_and_broad_ones_are_marked() {
        let row = |cell: &str| format!("{}|\n", format!("| {cell} ").repeat(MIN_BROAD));
        let broad = [row("a"), row("---"), row("1")].concat();
        let narrow = "| a |\n|---|\n| 1 |\n";
        let html = page(&format!("# Head\n\n{narrow}\n## `a` < \"b\"\n\n{broad}"), Vec::new());
        for part in [
            "<div class=\"wide\" role=\"region\" aria-label=\"Table: Head\" tabindex=\"0\"><table>",
            "<div class=\"wide broad\" role=\"region\" aria-label=\"Table: a &lt; &quot;b&quot;\" tabindex=\"0\"><table>",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        assert_eq!(html.matches("<div").count(), html.matches("</div>").count());
    }

    #[test]
    fn numbers_in_cells_stay_on_one_line() {
        let html = page("# 1e-9\n\n| e-6 |\n|---|\n| right 8 (2e-7), <the-1> |\n", Vec::new());
        let cell = "<td>right 8 <span class=\"power\">(2e-7),</span> &lt;the-1&gt;</td>";
        assert!(html.contains(cell) && html.contains("1e-9</h1>"), "{html}");
    }

    #[test]
    fn a_name_of_the_plots_has_one_mark_everywhere() {
        let plots = [("a.svg", "3 sr\n12 exact"), ("b.svg", "3 sr")];
        let plots = plots.map(|(name, keys)| {
            let desc = "<desc>Each point is one setting.</desc>";
            (
                name,
                format!("<svg width=\"1\">{desc}<metadata>{keys}</metadata></svg>"),
            )
        });
        let figures = plots.iter().map(|(name, content)| Figure {
            name,
            content: content.as_bytes(),
            caption: None,
        });
        let report = "# Head\n\n| method | sr |\n|---|---|\n| sr | sr (64 rays) |\n| exact | other |\n";
        let html = page(report, figures.collect());
        let (sr, exact) = (mark::inline(3), mark::inline(12));
        for part in [
            format!("<li>{sr}sr</li>"),
            format!("<li>{exact}exact</li>"),
            format!("<td>{sr}sr</td><td>{sr}sr (64 rays)</td>"),
            format!("<td>{exact}exact</td><td>other</td>"),
            format!("<button type=\"button\">{sr}sr</button>"),
            "<svg role=\"img\" aria-label=\"Each point is one setting.\"".to_owned(),
            "<figcaption>Each point is one setting. The file is <code>a.svg</code>.</figcaption>".to_owned(),
        ] {
            assert!(html.contains(&part), "{part}: {html}");
        }
        assert_eq!(html.matches("class=\"mark\"").count(), 2 + 4);
    }

    #[test]
    fn nothing_is_loaded_and_only_the_page_s_own_script_runs() {
        let svg = b"<svg width=\"1\" height=\"1\"></svg>";
        let figures = [("a-plot.svg", &svg[..]), ("b.png", b"\x89PNG")];
        let figures = figures.map(|(name, content)| Figure {
            name,
            content,
            caption: None,
        });
        let html = page(
            "<script>alert(1)</script> ![x](http://example.org/x.png)",
            figures.to_vec(),
        );
        assert_eq!(html.matches("<script").count(), 1, "{html}");
        assert!(SCRIPT.lines().count() < 60 && !SCRIPT.contains("</"));
        assert!(html.contains("&lt;script&gt;"));
        assert!(html.contains("<svg role=\"img\" aria-label=\"A plot\" width=\"1\""));
        assert!(html.contains("data:image/png;base64,iVBORw=="));
        assert!(html.contains("<figcaption>B is the image in <code>b.png</code>.</figcaption>"));
        // External images are left out, so all are data.
        assert!(
            html.matches("src=\"").count() == html.matches("src=\"data:").count(),
            "{html}"
        );
    }
}
