"""A report in a real browser: opened from a file, with all that it says or asks for."""

import io

import numpy as np
from PIL import Image

FLAGS = (
    "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip


class Visit:
    """A page opened from a file, with everything it says, asks for or pops up."""

    def __init__(self, chromium, path, *, ready="body[data-ready]", script=None, **options):
        self.page = chromium.new_page(**options)
        self.page.set_default_timeout(15_000)
        self.errors, self.requests, self.dialogs = [], [], []
        self.page.on("console", lambda m: m.type == "error" and self.errors.append(m.text))
        self.page.on("pageerror", lambda e: self.errors.append(str(e)))
        self.page.on("dialog", lambda d: (self.dialogs.append(d.message), d.dismiss()))
        self.page.on("request", lambda r: self.requests.append(r.url))
        self.page.context.set_offline(True)
        if script:
            self.page.add_init_script(script)
        self.page.goto(path.as_uri(), timeout=60_000)
        self.page.wait_for_selector(ready, timeout=60_000)
        self.home = path.as_uri()

    def picture(self, plot=0):
        image = Image.open(io.BytesIO(self.page.locator(f"#plot{plot}").screenshot()))
        return np.asarray(image.convert("RGB")).astype(int)

    def settled(self):
        self.page.evaluate("report.update()")

    def press(self, key):
        self.page.keyboard.press(key)
        self.settled()

    def faces(self):
        self.settled()
        return self.page.evaluate("report.views[0].faces.owner.length")

    def close(self):
        self.page.close()
        assert self.errors == []
        assert self.dialogs == []
        assert [
            url for url in self.requests if url != self.home and url[:5] not in ("data:", "blob:")
        ] == []
