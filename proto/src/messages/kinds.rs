//! Enumerations that messages carry as `u32`.

enumeration! {
    /// What a setpoint asks for.
    SetpointKind {
        /// Nothing: zero thrust.
        Zero = 0 "zero",
        /// Thrust, N.
        Thrust = 1 "thrust_n",
        /// Shaft speed, rad/s.
        Speed = 2 "speed_rad_s",
    }
}

enumeration! {
    /// Unit of the drive in a [`Command`](super::Command); must be the one of the servo's amplifier.
    DriveKind {
        /// Motor current, A.
        Current = 0 "current_cmd_a",
        /// Motor voltage, V.
        Voltage = 1 "voltage_cmd_v",
        /// Duty, -1 to 1.
        Duty = 2 "duty_cmd",
        /// Shaft speed, rad/s.
        Speed = 3 "speed_cmd_rad_s",
    }
}

enumeration! {
    /// What a [`Request`](super::Request) wants.
    RequestKind {
        /// Arm the servo.
        Arm = 1 "arm",
        /// Disarm: zero at once.
        Disarm = 2 "disarm",
        /// Clear latched faults whose cause is gone; stays disarmed.
        ClearFaults = 3 "clear-faults",
        /// Switch the control law, or change its parameters.
        SetController = 4 "set-controller",
        /// Ramp the setpoint to zero and hold it there, whoever commands: the service is about to end.
        Rest = 5 "rest",
        /// Go on with the revision of the rig description that lies beside the shared memory.
        SetRig = 6 "set-rig",
        /// Send the servo no commands for [`ASIDE_NS`](super::ASIDE_NS): somebody else takes the controller's place for a
        /// while, and asks again and again while they do.
        StandAside = 7 "stand-aside",
    }
}

enumeration! {
    /// Who answers.
    Process {
        /// The servo.
        Servo = 1 "servo",
        /// The controller.
        Controller = 2 "controller",
        /// The gateway.
        Gateway = 3 "gateway",
        /// The supervisor.
        Supervisor = 4 "supervisor",
    }
}

enumeration! {
    /// The answer to a [`Request`](super::Request).
    Outcome {
        /// Done.
        Done = 1 "done",
        /// Understood, but the present state forbids it.
        Refused = 2 "refused",
        /// Unknown name, value out of range.
        Invalid = 3 "invalid",
    }
}
