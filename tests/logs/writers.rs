//! Writers of logs for tests, each from the public description of its format.

/// Speed of a motor in its k-th tick, rpm.
pub fn rpm(motor: u8, k: u32) -> f64 {
    f64::from(100 * u32::from(motor) + 3 * k)
}

/// Pulse of an output in its k-th tick, us.
pub fn pulse(output: u8, k: u32) -> u16 {
    (1500 + 10 * u32::from(output) + k % 300) as u16
}

/// ArduPilot DataFlash: outputs at 50 Hz, two speed controllers at 25 Hz, a battery at 10 Hz, motion at 50 Hz.
pub fn dataflash(ticks: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let fixed = |text: &str, length: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(length, 0);
        bytes
    };
    let message = |out: &mut Vec<u8>, kind: u8, payload: &[u8]| {
        out.extend([0xa3, 0x95, kind]);
        out.extend(payload);
    };
    let describe = |out: &mut Vec<u8>, kind: u8, length: u8, name: &str, format: &str, labels: &str| {
        let payload = [&[kind, length][..], &fixed(name, 4), &fixed(format, 16), &fixed(labels, 64)].concat();
        message(out, 0x80, &payload);
    };
    describe(&mut out, 0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
    describe(&mut out, 0x81, 3 + 8 + 1 + 64, "UNIT", "QbZ", "TimeUS,Id,Label");
    describe(&mut out, 0x82, 3 + 8 + 1 + 8, "MULT", "Qbd", "TimeUS,Id,Mult");
    describe(&mut out, 0x83, 3 + 8 + 1 + 16 + 16, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
    describe(&mut out, 10, 3 + 8 + 4, "RCOU", "QHH", "TimeUS,C1,C2");
    describe(&mut out, 11, 3 + 8 + 1 + 4 + 2 + 2 + 4, "ESC", "QBfCCf", "TimeUS,Instance,RPM,Volt,Curr,CTot");
    describe(&mut out, 12, 3 + 8 + 1 + 4 + 4, "BAT", "QBff", "TimeUS,Inst,Volt,Curr");
    describe(&mut out, 13, 3 + 8 + 1 + 12 + 12, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
    let time = |us: u64| us.to_le_bytes();
    for (id, label) in [
        ('s', "s"),
        ('#', "instance"),
        ('q', "rpm"),
        ('v', "V"),
        ('A', "A"),
        ('a', "Ah"),
        ('Y', "us"),
        ('E', "rad/s"),
        ('o', "m/s/s"),
    ] {
        message(&mut out, 0x81, &[&time(100)[..], &[id as u8], &fixed(label, 64)].concat());
    }
    for (id, factor) in [('-', 0.0), ('B', 1e-2), ('C', 1e-3), ('F', 1e-6_f64), ('0', 1.0)] {
        message(&mut out, 0x82, &[&time(100)[..], &[id as u8], &factor.to_le_bytes()].concat());
    }
    for (kind, units, multipliers) in
        [(10, "sYY", "F--"), (11, "s#qvAa", "F-0BBC"), (12, "s#vA", "F-00"), (13, "s#EEEooo", "F-000000")]
    {
        message(
            &mut out,
            0x83,
            &[&time(100)[..], &[kind], &fixed(units, 16), &fixed(multipliers, 16)].concat(),
        );
    }
    for k in 0..ticks {
        let us = 5_000_000 + u64::from(k) * 20_000;
        let pulses = [pulse(1, k).to_le_bytes(), pulse(2, k).to_le_bytes()].concat();
        message(&mut out, 10, &[&time(us)[..], &pulses].concat());
        let motion = [0.0_f32, 0.0, 0.0, 0.1, 0.0, -9.8].map(f32::to_le_bytes).concat();
        message(&mut out, 13, &[&time(us + 400)[..], &[0], &motion].concat());
        for motor in 0..2 {
            if k % 2 == 0 {
                let speed = (rpm(motor, k) as f32).to_le_bytes();
                let (volt, current) = (1480_u16.to_le_bytes(), 250_u16.to_le_bytes());
                let total = (k as f32).to_le_bytes();
                let payload = [&time(us + 900)[..], &[motor], &speed, &volt, &current, &total].concat();
                message(&mut out, 11, &payload);
            }
        }
        if k % 5 == 0 {
            let battery = [14.8_f32, 5.0].map(f32::to_le_bytes).concat();
            message(&mut out, 12, &[&time(us + 1300)[..], &[0], &battery].concat());
        }
    }
    out
}

/// `candump -L` of a VESC with number 5 and 7 pole pairs, and of a CANopen drive with its second process data.
pub fn candump(ticks: u32) -> String {
    let mut out = String::new();
    for k in 0..ticks {
        let stamp_s = 1_700_000_000.0 + f64::from(k) * 0.01;
        let (turns, current, duty) = (700 * k as i32, -15_i16, 250_i16);
        out += &format!("({stamp_s:.6}) can0 00000905#{turns:08X}{current:04X}{duty:04X}\n");
        let velocity = (100 - 3 * k as i32).swap_bytes();
        out += &format!("({:.6}) can0 281#3706{velocity:08X}\n", stamp_s + 0.001);
        if k % 10 == 0 {
            out += &format!("({:.6}) can0 301#0F00{:08X}\n", stamp_s + 0.002, 100_i32.swap_bytes());
        }
    }
    out
}

/// A blackbox as Betaflight 4.5 writes it, with the speed of one motor: every eighth frame is whole, the others say what changed.
#[allow(dead_code)]
pub fn blackbox(frames: i64) -> Vec<u8> {
    let mut out = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n\
        H Field I name:loopIteration,time,motor[0],vbatLatest,eRPM[0]\nH Field I signed:0,0,0,0,0\n\
        H Field I predictor:0,0,11,9,0\nH Field I encoding:1,1,1,3,1\n\
        H Field P predictor:6,2,3,1,1\nH Field P encoding:9,0,8,8,8\n\
        H Firmware revision:Betaflight 4.5.1 (77d01ba3b) STM32H743\nH motorOutput:158,2047\nH motor_poles:14\nH vbatref:2400\n"
        .to_vec();
    fn unsigned(out: &mut Vec<u8>, mut value: u32) {
        while value > 127 {
            out.push(value as u8 | 0x80);
            value >>= 7;
        }
        out.push(value as u8);
    }
    let zigzag = |value: i64| ((value << 1) ^ (value >> 63)) as u32;
    let of = |k: i64| [5_000_000 + 500 * k + k % 3, 158 + 10 * (k % 50), 2400 - k % 7, erpm(k)];
    let (mut last, mut before) = (of(0), of(0));
    for k in 0..frames {
        let now = of(k);
        if k % 8 == 0 {
            out.push(b'I');
            unsigned(&mut out, 8 * k as u32);
            unsigned(&mut out, now[0] as u32);
            unsigned(&mut out, (now[1] - 158) as u32);
            unsigned(&mut out, ((2400 - now[2]) & 0x3fff) as u32);
            unsigned(&mut out, now[3] as u32);
            before = now;
        } else {
            out.push(b'P');
            unsigned(&mut out, zigzag(now[0] - (2 * last[0] - before[0])));
            // Motor, voltage and speed in 16 bits each, a fourth that is none.
            out.push(0b00_11_11_11);
            for value in [now[1] - (last[1] + before[1]) / 2, now[2] - last[2], now[3] - last[3]] {
                out.extend((value as i16).to_be_bytes());
            }
            before = last;
        }
        last = now;
    }
    out.extend(b"E\xffEnd of log\0");
    out
}

/// Hundreds of electrical turns a minute of the motor in that log.
#[allow(dead_code)]
pub fn erpm(k: i64) -> i64 {
    900 + 3 * (k % 40)
}
