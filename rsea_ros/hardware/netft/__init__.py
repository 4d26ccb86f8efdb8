"""An ATI Net F/T sensor: RDT over UDP, with its calibration from its web page."""
