//! Application in another program, which sees the process image in a file.

use std::path::PathBuf;

use linesman_config::plan::Plan;
use linesman_link::shared_image::{ImageState, SharedImage};

use linesman_proto::address::DeviceId;
use linesman_session::{Application, Io, Next};

/// States of so many SubDevices are brought up to date in a cycle, in turn.
const STATES_A_CYCLE: usize = 64;

/// Inputs for whoever wants to read them, outputs from the one program that gives them. The file is
/// made in the first cycle and removed at the end.
pub struct Shared {
    path: PathBuf,
    image: Option<SharedImage>,
    /// Count of the outputs that were taken last.
    last: u64,
    state: ImageState,
    /// The SubDevice whose state comes next.
    next: usize,
}

impl Shared {
    /// An image in a file at `path`.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self { path, image: None, last: 0, state: ImageState::default(), next: 0 }
    }
}

impl Application for Shared {
    fn begin(&mut self, plan: &Plan) -> Result<(), String> {
        let Plan { inputs_len, outputs_len, devices, .. } = plan;
        let image = SharedImage::create(&self.path, *inputs_len, *outputs_len, devices.len());
        let image = image.map_err(|error| {
            let path = self.path.display();
            format!("{path}: making the process image: {error}. Do: name a file in /dev/shm")
        })?;
        self.image = Some(image);
        Ok(())
    }

    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        let Some(image) = &self.image else { return Next::Stop };
        self.state = ImageState {
            cycles: io.statistics().cycles,
            time_ns: io.now().as_nanos(),
            settled: io.is_settled(),
            withheld: io.is_withheld(),
            ended: false,
            network: io.network_state().0,
            responding_by_card: io.responding_by_card().unwrap_or_default(),
        };
        let count = image.devices();
        let first = self.next;
        self.next = (first + STATES_A_CYCLE) % count.max(1);
        let indices = (first..first + STATES_A_CYCLE.min(count)).map(|at| at % count);
        let states = indices.map(|at| (at, io.state(DeviceId(at as u32)).0));
        image.publish(io.inputs(), &self.state, states);
        // Its first outputs count; what stays as it was is old.
        if !image.take_outputs(io.outputs_mut(), &mut self.last) {
            io.outputs_are_old();
        }
        Next::Continue
    }

    fn interface_gone(&mut self, io: &mut Io<'_>) {
        // Published at the end of the run.
        self.state.network = io.network_state().0;
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        if let Some(image) = &self.image {
            let mut inputs = vec![0; image.inputs_len()];
            // Whoever looks on learns that nothing will change any more.
            if image.read_inputs(&mut inputs).is_some() {
                image.publish(&inputs, &ImageState { ended: true, ..self.state }, []);
            }
        }
    }
}
