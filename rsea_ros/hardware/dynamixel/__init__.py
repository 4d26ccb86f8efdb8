"""A Dynamixel Pro on RS-485: Protocol 2.0 over dynamixel-sdk, with its wrong parts replaced."""
