//! The parts of HTML that the pages of reports share.
//!
//! In: text, and parts of a page that are HTML already. Out: elements; a page with its style and its script inside,
//! which loads nothing.

/// The style of all pages.
const STYLE: &str = include_str!("page.css");

/// A page.
pub(crate) struct Page<'a> {
    /// The title, text.
    pub title: &'a str,
    /// The line below the title, text.
    pub about: &'a str,
    /// The style besides that of all pages.
    pub style: &'a str,
    /// The rest of the page, HTML.
    pub body: &'a str,
    /// The script; empty if the page has none.
    pub script: &'a str,
}

impl Page<'_> {
    /// Returns the page.
    pub(crate) fn html(&self) -> String {
        let Self { style, body, .. } = self;
        let (title, about) = (escape(self.title), paragraph("soft", self.about));
        let script = if self.script.is_empty() { String::new() } else { element("script", "", self.script) };
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{title}</title>\
             <style>{STYLE}{style}</style></head>\
             <body><main><h1>{title}</h1>{about}{body}</main>{script}</body></html>\n"
        )
    }
}

/// Escapes the special characters of HTML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns an element of these classes, separated by spaces, with HTML in it.
pub(crate) fn element(tag: &str, classes: &str, body: &str) -> String {
    match classes {
        "" => format!("<{tag}>{body}</{tag}>"),
        _ => format!("<{tag} class=\"{classes}\">{body}</{tag}>"),
    }
}

/// Returns a paragraph of these classes.
pub(crate) fn paragraph(classes: &str, text: &str) -> String {
    element("p", classes, &escape(text))
}

/// Returns a card of these classes: a title, and HTML below it.
pub(crate) fn card(classes: &str, title: &str, body: &str) -> String {
    element("section", format!("card {classes}").trim_end(), &(element("h2", "", &escape(title)) + body))
}

/// Returns a table of the cells of its head and the cells of each row, HTML.
pub(crate) fn table(head: &str, rows: impl IntoIterator<Item = String>) -> String {
    let rows: String = rows.into_iter().collect();
    element("table", "", &(element("thead", "", &element("tr", "", head)) + &element("tbody", "", &rows)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_html_is_not() {
        let body = card("wide", "<a>", &table("<th>b</th>", ["<tr></tr>".to_owned()]));
        let page = Page { title: "<c>", about: "\"d\" & e", style: "", body: &body, script: "" }.html();
        for text in ["<title>&lt;c&gt;</title>", "<p class=\"soft\">&quot;d&quot; &amp; e</p>", "<h2>&lt;a&gt;</h2>"] {
            assert!(page.contains(text), "{text}: {page}");
        }
        let table = "<table><thead><tr><th>b</th></tr></thead><tbody><tr></tr></tbody></table>";
        assert!(page.contains(&format!("{table}</section></main></body>")), "the table in its card: {page}");
    }
}
