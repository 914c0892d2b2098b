//! The HTML skeleton that all pages share.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page with the common style, which needs no file beside it.
pub fn document(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    }
}

/// Dark on white; the status colours have a contrast of at least 7 to 1 with their text.
const STYLE: &str = "
:root { color-scheme: only light; }
body { font: 16px/1.45 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 64rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0.5rem 0 1rem; }
h2 { font-size: 1.25rem; margin: 2rem 0 0.6rem; }
.banner { display: flex; flex-wrap: wrap; align-items: baseline; gap: 0.2rem 1.2rem; margin: 0;
  padding: 0.8rem 1.2rem; border: 2px solid; border-radius: 0.4rem; font-size: 1.15rem; }
.banner strong { font-size: 2.6rem; line-height: 1.1; }
.passed { color: #0f4a1c; background: #e4f4e7; border-color: #2c7a3c; }
.failed { color: #7d0c0c; background: #fde6e6; border-color: #b31b1b; }
.untested { color: #5a3c00; background: #fff2cc; border-color: #b58900; }
ul { list-style: none; margin: 1rem 0 0; padding: 0; }
li { margin: 0.3rem 0; }
nav { display: flex; gap: 1.2rem; margin-top: 1rem; }
a { color: #123f8c; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 0.35rem 0.6rem;
  border-bottom: 1px solid #d5d5d5; }
thead th { border-bottom: 2px solid #1a1a1a; }
tbody th { font-weight: normal; }
tbody th.group { font-weight: bold; padding-top: 1rem; }
td.figure, .status { white-space: nowrap; font-variant-numeric: tabular-nums; }
.status { display: inline-block; padding: 0 0.5rem; border: 1px solid; border-radius: 0.3rem; }
td.detail { font-size: 0.9rem; color: #404040; overflow-wrap: anywhere; }
pre { overflow-x: auto; font-size: 0.85rem; line-height: 1.3; }
.notes { width: auto; }
.notes td { overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
figure { margin: 0 0 2rem; break-inside: avoid; }
.drawing { overflow-x: auto; }
.drawing svg { display: block; width: 100%; min-width: 40rem; height: auto; }
figcaption { font-size: 0.95rem; color: #404040; margin-top: 0.3rem; }
@media (max-width: 44rem) {
  .checks thead { position: absolute; clip-path: inset(50%); height: 1px; overflow: hidden; }
  .checks, .checks tbody, .checks tr, .checks th, .checks td { display: block; }
  .checks tr { border-bottom: 1px solid #d5d5d5; padding: 0.4rem 0; }
  .checks th, .checks td { border: 0; padding: 0.1rem 0; }
  td.figure { white-space: normal; }
  td[data-name]::before { content: attr(data-name) \": \"; color: #404040; }
}
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  .drawing svg { min-width: 0; max-height: 24cm; }
  nav { display: none; }
  thead { display: table-header-group; }
  tr { break-inside: avoid; }
  .banner, .status { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
";
