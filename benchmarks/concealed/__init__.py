"""Independent simulator of piezo-actuator recordings with concealed effects (no fracjax code)."""
