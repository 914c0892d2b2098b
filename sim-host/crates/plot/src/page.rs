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

/// A figure: the SVG document inline, on white ground, and its caption.
pub fn figure(id: &str, svg: &str, caption: &Markup) -> Markup {
    html! {
        figure id=(id) {
            // Wider than a narrow screen, so that its texts stay readable: it can be scrolled, also by keys.
            div.drawing tabindex="0" role="group" aria-label="figure" { (PreEscaped(svg)) }
            figcaption { (caption) }
        }
    }
}

/// Light or dark as the reader's system is, always light in print. The status colours have a
/// contrast of at least 7 to 1 with their text.
const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1a1a1a; --ground: #fff; --faint: #454545; --rule: #d5d5d5; --link: #123f8c;
  --passed: #0f4a1c; --passed-ground: #e0f2e3; --passed-rule: #2c7a3c;
  --failed: #7d0c0c; --failed-ground: #fde2e2; --failed-rule: #b31b1b;
  --open: #503500; --open-ground: #fff0c4; --open-rule: #a87e00; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e8e8e8; --ground: #161719; --faint: #bdbdbd; --rule: #44474c; --link: #a9c7ff;
    --passed: #b9efc4; --passed-ground: #14341c; --passed-rule: #4ba362;
    --failed: #ffc9c9; --failed-ground: #4a1414; --failed-rule: #e06666;
    --open: #ffe6a0; --open-ground: #3c2f06; --open-rule: #c9a227; }
}
@media print { :root { color-scheme: light; } }
body { font: 16px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--ground);
  max-width: 64rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0.3rem 0 0.8rem; }
h2 { font-size: 1.25rem; margin: 1.8rem 0 0.6rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 0.4rem; }
.banner { display: flex; flex-wrap: wrap; align-items: baseline; gap: 0.2rem 1.2rem; margin: 0 0 1rem;
  padding: 0.4rem 1.2rem; border: 2px solid; border-radius: 0.4rem; font-size: 1.15rem; }
.banner strong { font-size: 2.2rem; line-height: 1.2; }
.passed { color: var(--passed); background: var(--passed-ground); border-color: var(--passed-rule); }
.failed { color: var(--failed); background: var(--failed-ground); border-color: var(--failed-rule); }
.untested, .in-part { color: var(--open); background: var(--open-ground); border-color: var(--open-rule); }
ul { list-style: none; margin: 1rem 0; padding: 0; }
li { margin: 0.3rem 0; }
nav { display: flex; flex-wrap: wrap; gap: 0.3rem 1.2rem; margin-top: 1rem; }
a { color: var(--link); }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 0.35rem 0.6rem; border-bottom: 1px solid var(--rule); }
thead th { border-bottom: 2px solid var(--ink); }
tbody th { font-weight: normal; }
.matrix { font-variant-numeric: tabular-nums; }
.matrix th { padding: 0.25rem 0.5rem; vertical-align: middle; line-height: 1.25; }
.matrix thead th { vertical-align: bottom; }
.matrix td { padding: 0; vertical-align: middle; border: 2px solid var(--ground); }
.matrix td a { display: block; padding: 0.25rem 0.5rem; color: inherit; text-decoration: none; line-height: 1.25; }
.matrix td a:hover, .matrix td a:focus-visible { text-decoration: underline; }
.matrix .symbol { font-weight: bold; }
.matrix .none { padding: 0.25rem 0.5rem; color: var(--faint); }
.matrix td, .matrix thead th + th { white-space: nowrap; }
.unseen { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
.checks tbody + tbody { border-top: 2px solid var(--rule); }
:target { outline: 3px solid var(--link); outline-offset: -1px; }
td.figure, .status { white-space: nowrap; font-variant-numeric: tabular-nums; }
.status { display: inline-block; padding: 0 0.5rem; border: 1px solid; border-radius: 0.3rem; }
td.detail { font-size: 0.9rem; color: var(--faint); overflow-wrap: anywhere; }
details { border-bottom: 1px solid var(--rule); }
summary { cursor: pointer; padding: 0.4rem 0; }
details[open] > summary { font-weight: bold; }
pre { overflow-x: auto; font-size: 0.85rem; line-height: 1.3; }
dt { font-weight: bold; }
dd { margin: 0 0 0.3rem 1rem; }
.notes { width: auto; }
.notes td { overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0 2rem; break-inside: avoid; }
.drawing { overflow-x: auto; background: #fff; border-radius: 0.3rem; }
.drawing svg { display: block; width: 100%; min-width: 40rem; height: auto; }
figcaption { font-size: 0.95rem; color: var(--faint); margin-top: 0.3rem; }
@media (max-width: 44rem) {
  body { padding: 0.6rem; }
  .matrix { font-size: 0.85rem; }
  .matrix th { padding-left: 0; }
  .matrix.many thead th + th { height: 7.5rem; padding: 0.3rem 0; text-align: center; }
  .matrix.many thead th + th span { writing-mode: vertical-rl; transform: rotate(180deg); }
  .matrix.many th { padding: 0.2rem 0.3rem 0.2rem 0; }
  .matrix.many td a, .matrix.many .none { padding: 0.35rem 0; min-width: 1.6rem; text-align: center; }
  .matrix.many .word { display: none; }
  .checks thead { position: absolute; clip-path: inset(50%); height: 1px; overflow: hidden; }
  .checks, .checks tbody, .checks tr, .checks th, .checks td { display: block; }
  .checks tr { border-bottom: 1px solid var(--rule); padding: 0.4rem 0; }
  .checks th, .checks td { border: 0; padding: 0.1rem 0; }
  .notes tr, .notes th, .notes td { display: block; border: 0; padding: 0.1rem 0; }
  .notes tr { border-bottom: 1px solid var(--rule); padding: 0.4rem 0; }
  .notes th { font-weight: bold; }
  td.figure { white-space: normal; }
  td[data-name]::before { content: attr(data-name) \": \"; color: var(--faint); }
}
@media print {
  :root { font-size: 10pt; }
  body { max-width: none; padding: 0; font-size: 1rem; }
  .drawing { overflow: visible; }
  .drawing svg { min-width: 0; max-height: 24cm; }
  nav { display: none; }
  thead { display: table-header-group; }
  tr, .banner { break-inside: avoid; }
  h2, h3, summary { break-after: avoid; }
  details.printed::details-content { content-visibility: visible; display: block; block-size: auto; }
  .banner, .status, .matrix td { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
";
