# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Signing in to the page of a farm with certificates, and out. For page_test.py."""
from farm import wait_until
from secure_farm_test import SecureFarm
from viewer_checks import FOCUS, HIDDEN, TEXT

SECONDS_MAX = 20
ENTER = "\ue007"
PATH = "return location.pathname"
SIGN_IN = """
  document.getElementById("token").value = arguments[0];
  document.querySelector("form").requestSubmit();"""


def check_session(browser, _):
    with SecureFarm() as farm:
        farm.log_in("anna", "view")
        page, token = farm.person("anna", "page").stdout.split()
        browser.open(page)
        browser.run(SIGN_IN, token)
        wait_until(lambda: browser.run(PATH) == "/" and
                   browser.run(TEXT, "connection-text") == "Live", SECONDS_MAX, "the page")
        wait_until(lambda: not browser.run(HIDDEN, "sign-out"), SECONDS_MAX, "the button")
        title = browser.run("return document.getElementById('sign-out').title")
        assert title == "Signed in as anna, with the role view", title
        browser.run("location.hash = '/workers'")
        words = "return document.getElementById('worker-drain').title"
        wait_until(lambda: browser.run(words) ==
                   "This needs the role operate; you have the role view", SECONDS_MAX, "the role")
        browser.run(FOCUS, "sign-out")
        browser.press(ENTER)
        wait_until(lambda: browser.run(PATH) == "/login", SECONDS_MAX, "the form")
        browser.open(f"https://{farm.http}/")
        assert browser.run(PATH) == "/login", "the session continues"
        assert any(line["what"] == "sign out" and line["who"].startswith("user:anna")
                   for line in farm.audit())
        browser.open("about:blank")
