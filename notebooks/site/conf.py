"""What Sphinx is told. The pages that it reads are staged by `notebooks/site/builder`."""

project = "gantrytau"
author = "the gantrytau authors"
extensions = ["myst_nb"]
html_theme = "furo"
html_title = "gantrytau"
html_static_path = ["style"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_logo = html_favicon = "style/logo.svg"
html_copy_source = False
html_show_copyright = False
html_last_updated_fmt = None

nb_execution_mode = "off"  # they come executed
nb_merge_streams = True
nb_render_markdown_format = "myst"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
suppress_warnings = [
    "misc.highlighting_failure",  # formulas and outputs beside code
    "myst.header",  # pages of folders begin where they begin
]

smartquotes = False  # a sentence says what the source says
add_module_names = False
python_maximum_signature_line_length = 88
toc_object_entries = False
maximum_signature_line_length = 88
