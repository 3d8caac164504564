# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A headless Chromium that looks at the page of the viewer."""

from io import BytesIO
import shutil
import time

import numpy as np
import pytest

CHROMIUM = shutil.which('chromium') or shutil.which('google-chrome')
DRIVER = shutil.which('chromedriver')
FLAGS = ('--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--hide-scrollbars',
         '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader')
DEADLINE = 120.0        # s; generous, nothing is asserted about how long something takes


class Browser:
    """A window of a headless Chromium, drawn in software."""

    def __init__(self, width=1000, height=700):
        """Open it; skips the test where that cannot be."""
        webdriver = pytest.importorskip('selenium.webdriver', reason='needs selenium')
        if not (CHROMIUM and DRIVER):
            pytest.skip('needs chromium and chromedriver')
        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        for flag in (*FLAGS, f'--window-size={width},{height}'):
            options.add_argument(flag)
        self.driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))

    def visit(self, url):
        """Open a page, and wait until it says something."""
        self.driver.get(url)
        self.wait(lambda: 'particles' in self.text())

    def wait(self, condition):
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, 'the page does not come to that'
            time.sleep(0.1)

    def text(self):
        return self.driver.execute_script('return document.body.innerText')

    def picture(self):
        """Red, green, blue of the window, (height, width, 3) int64."""
        from PIL import Image
        image = Image.open(BytesIO(self.driver.get_screenshot_as_png()))
        return np.asarray(image.convert('RGB')).astype(np.int64)

    def click(self, label):
        script = ('for (const b of document.querySelectorAll("button")) '
                  'if (b.innerText.trim() === arguments[0]) { b.click(); return true; } '
                  'return false')
        assert self.driver.execute_script(script, label), label

    def close(self):
        self.driver.quit()
