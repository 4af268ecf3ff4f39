//! States of SubDevices as SOEM reads and writes them.

use linesman_maindevice::{Request, Target};
use linesman_proto::register::{AL_CONTROL, AL_STATUS};
use linesman_proto::time::Span;

use super::bus::{Bus, RETURN, SURELY};
use super::device::{Device, ERROR, INIT, NONE, OP, PRE_OP, SAFE_OP};

/// How long a state is waited for: `EC_TIMEOUTSTATE`.
pub(super) const TIMEOUT: Span = Span::s(2);
/// AL status with its code.
const WITH_CODE: u16 = 6;
/// Between two looks.
const AGAIN: Span = Span::ms(1);
/// SubDevices that are asked in one frame: `MAX_FPRD_MULTI`.
const TOGETHER: usize = 64;
const STATE: u16 = 0x0F;

/// Writes AL control of one SubDevice.
pub(super) async fn request(bus: &Bus, device: &Device, state: u16, timeout: Span) -> bool {
    bus.write(device.target(), AL_CONTROL.address.0, &state.to_le_bytes(), timeout).await
}

/// Writes AL control of all.
pub(super) async fn request_all(bus: &Bus, state: u16) {
    bus.write(Target::All, AL_CONTROL.address.0, &state.to_le_bytes(), SURELY).await;
}

/// Waits until a SubDevice is in a state (`ecx_statecheck`); says whether it is.
pub(super) async fn reach(bus: &Bus, device: &mut Device, state: u16, timeout: Span) -> bool {
    let end = bus.now() + timeout;
    loop {
        let at = AL_STATUS.address.0;
        let status = bus.read(device.target(), at, WITH_CODE.into(), RETURN).await.word(0);
        device.state = status & (STATE | ERROR);
        if status & STATE == state {
            return true;
        }
        bus.sleep(AGAIN).await;
        if bus.now() >= end {
            return false;
        }
    }
}

/// Waits until all are in a state together; says whether they are.
pub(super) async fn reach_all(bus: &Bus, state: u16, timeout: Span) -> bool {
    let end = bus.now() + timeout;
    loop {
        let status = bus.read(Target::All, AL_STATUS.address.0, 2, RETURN).await.word(0);
        if status & STATE == state {
            return true;
        }
        bus.sleep(AGAIN).await;
        if bus.now() >= end {
            return false;
        }
    }
}

/// Reads the states of all by one broadcast; when they differ, there is an error, or fewer answer than there are, of
/// each (`ecx_readstate`).
pub(super) async fn read(bus: &Bus, devices: &mut [Device]) {
    let reply = bus.read(Target::All, AL_STATUS.address.0, 2, RETURN).await;
    let status = reply.word(0);
    let are_alike = matches!(status & STATE, INIT | PRE_OP | SAFE_OP | OP);
    if are_alike && status & ERROR == 0 && usize::from(reply.wkc.0) >= devices.len() {
        devices.iter_mut().for_each(|device| device.state = status & STATE);
        return;
    }
    for some in devices.chunks_mut(TOGETHER) {
        let ask = |device: &Device| Request::read(device.target(), AL_STATUS.address, WITH_CODE);
        let requests: Vec<Request> = some.iter().map(ask).collect();
        let mut replies = bus.ask_together(&requests, SURELY).await.into_iter();
        for device in some {
            device.state = replies.next().map_or(NONE, |reply| reply.word(0) & (STATE | ERROR));
        }
    }
}
